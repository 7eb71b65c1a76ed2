/* A flexaxis estimator in C, which estimates the motor friction f_m.
 *
 *     cc -O2 -o my_estimator my_estimator.c -lm
 *     flexaxis check 'pipe:./my_estimator'
 *
 * The program predicts the states of the axis and their sensitivities to f_m. Replace this method by
 * your own method.
 */
#include "flexaxis.h"

enum { ORDER = 16 }; /* order of the Taylor series of the matrix exponential, accurate at 5 ms */

typedef struct {
    double T, A[5][5], B, dA; /* x' = (A + (theta - f_m) dA) x + B u; dA, B: motor speed only */
    double x[5], dx[5], u;    /* states, their derivatives with respect to theta, the last input */
    double nominal, theta, P, forgetting;
} estimator;

/* x = [twist motor-gear, twist gear-arm, speeds of motor, gear and arm] */
static void start(estimator *e, const flexaxis_axis *axis) {
    double r = flexaxis_value(axis, "r"), f_m = flexaxis_value(axis, "f_m");
    double J_m = flexaxis_value(axis, "J_m"), J_g = flexaxis_value(axis, "J_g");
    double J_a = flexaxis_value(axis, "J_a"), k_g = flexaxis_value(axis, "k_g");
    double k_a = flexaxis_value(axis, "k_a"), d_g = flexaxis_value(axis, "d_g");
    double d_a = flexaxis_value(axis, "d_a"), f_g = flexaxis_value(axis, "f_g");
    double f_a = flexaxis_value(axis, "f_a");
    double A[5][5] = {
        {0, 0, r, -1, 0},
        {0, 0, 0, 1, -1},
        {-r * k_g / J_m, 0, -(r * r * d_g + f_m) / J_m, r * d_g / J_m, 0},
        {k_g / J_g, -k_a / J_g, r * d_g / J_g, -(f_g + d_g + d_a) / J_g, d_a / J_g},
        {0, k_a / J_a, 0, d_a / J_a, -(d_a + f_a) / J_a},
    };
    memset(e, 0, sizeof *e);
    memcpy(e->A, A, sizeof A);
    e->T = axis->period;
    e->B = flexaxis_value(axis, "k_T") / J_m;
    e->dA = -1 / J_m;
    e->nominal = e->theta = f_m;
    e->forgetting = 0.995;
    e->P = 1e-3 * (1 - e->forgetting);
}

/* Predicts states and sensitivities over one period by adding the terms of the Taylor series. */
static void predict(estimator *e) {
    double v[5], dv[5];
    memcpy(v, e->x, sizeof v);
    memcpy(dv, e->dx, sizeof dv);
    for (int n = 1; n <= ORDER; n++) {
        double w[5] = {0}, dw[5] = {0};
        for (int i = 0; i < 5; i++)
            for (int j = 0; j < 5; j++) {
                w[i] += e->A[i][j] * v[j];
                dw[i] += e->A[i][j] * dv[j];
            }
        w[2] += (e->theta - e->nominal) * e->dA * v[2] + (n == 1 ? e->B * e->u : 0);
        dw[2] += (e->theta - e->nominal) * e->dA * dv[2] + e->dA * v[2];
        for (int i = 0; i < 5; i++) {
            v[i] = w[i] * e->T / n, dv[i] = dw[i] * e->T / n;
            e->x[i] += v[i], e->dx[i] += dv[i];
        }
    }
}

static void step(void *state, double u, double y, double *theta) {
    estimator *e = state;
    predict(e);
    e->u = u; /* u acts from now on */
    if (!isnan(y)) { /* y is NaN in a gap */
        double psi = e->dx[2], gain = e->P * psi / (1 + psi * e->P * psi);
        double moved = e->theta + gain * (y - e->x[2]);
        e->theta = fmin(fmax(moved, 0.1 * e->nominal), 10 * e->nominal);
        e->P = (1 - gain * psi) * e->P / e->forgetting;
    }
    theta[0] = e->theta;
}

int main(void) {
    flexaxis_axis axis = flexaxis_open();
    const char *names[] = {"f_m"};
    estimator e;
    start(&e, &axis);
    flexaxis_serve(names, 1, FLEXAXIS_SPEED, step, &e);
    return 0;
}
