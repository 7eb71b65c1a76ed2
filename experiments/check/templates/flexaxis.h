/* Functions for a flexaxis estimator in C: flexaxis_open, flexaxis_value and flexaxis_serve.
 *
 * The functions implement version 1 of the `pipe:` protocol, in which all numbers are
 * little-endian. The functions need only C99 and the C library.
 */
#ifndef FLEXAXIS_H
#define FLEXAXIS_H

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef _WIN32
#include <fcntl.h>
#include <io.h>
#endif

#define FLEXAXIS_VERSION 1u
#define FLEXAXIS_MARK 0x01020304u /* has a different value if the byte order differs */
#define FLEXAXIS_NAME 32          /* length of a name in bytes, padded with NUL */
#define FLEXAXIS_MOST 64          /* largest number of names and of nominal values */

enum { FLEXAXIS_SPEED = 0, FLEXAXIS_INCREMENT = 1 };

typedef struct {
    double period;   /* [s] */
    uint32_t output; /* the signal y: FLEXAXIS_SPEED [rad/s] or FLEXAXIS_INCREMENT [rad/s] */
    uint32_t values, names;
    char value_name[FLEXAXIS_MOST][FLEXAXIS_NAME]; /* nominal parameters, SI */
    double value[FLEXAXIS_MOST];
    char name[FLEXAXIS_MOST][FLEXAXIS_NAME]; /* parameters that the scenario identifies */
} flexaxis_axis;

/* Processes u[k] and y[k] (NaN in a gap), and writes theta[k]. y[k+1] is the first output that u[k]
 * affects. */
typedef void (*flexaxis_step)(void *state, double u, double y, double *theta);

static void flexaxis_fail(const char *why) {
    fprintf(stderr, "flexaxis.h: %s\n", why);
    exit(1);
}

static void flexaxis_read(void *to, size_t size) {
    if (fread(to, 1, size, stdin) != size) flexaxis_fail("stdin ended too early");
}

/* Reads the description of the axis. */
static flexaxis_axis flexaxis_open(void) {
    static flexaxis_axis axis;
    char magic[8];
    uint32_t known[2], count[3], i;
#ifdef _WIN32
    _setmode(_fileno(stdin), _O_BINARY);
    _setmode(_fileno(stdout), _O_BINARY);
#endif
    flexaxis_read(magic, sizeof magic);
    flexaxis_read(known, sizeof known);
    if (memcmp(magic, "FLEXAXIS", 8) != 0) flexaxis_fail("stdin is not from flexaxis");
    if (known[0] != FLEXAXIS_VERSION || known[1] != FLEXAXIS_MARK)
        flexaxis_fail("different protocol version or byte order");
    flexaxis_read(&axis.period, sizeof axis.period);
    flexaxis_read(count, sizeof count);
    axis.output = count[0], axis.values = count[1], axis.names = count[2];
    if (axis.values > FLEXAXIS_MOST || axis.names > FLEXAXIS_MOST) flexaxis_fail("too many names");
    for (i = 0; i < axis.values; i++) {
        flexaxis_read(axis.value_name[i], FLEXAXIS_NAME);
        flexaxis_read(&axis.value[i], sizeof(double));
    }
    for (i = 0; i < axis.names; i++) flexaxis_read(axis.name[i], FLEXAXIS_NAME);
    return axis;
}

/* Returns a nominal parameter (SI) such as "J_a"; ends the program if it is unknown. */
static double flexaxis_value(const flexaxis_axis *axis, const char *name) {
    for (uint32_t i = 0; i < axis->values; i++)
        if (strcmp(axis->value_name[i], name) == 0) return axis->value[i];
    fprintf(stderr, "flexaxis.h: the nominal value of %s is unknown\n", name);
    exit(1);
}

/* Sends the names of the estimates, answers every sample, and returns at the end of the run. */
static void flexaxis_serve(const char *const *names, uint32_t p, uint32_t output,
                           flexaxis_step step, void *state) {
    uint32_t head[4] = {FLEXAXIS_VERSION, FLEXAXIS_MARK, p, output};
    uint64_t samples;
    double *sample = NULL, *theta = NULL;
    fwrite("FLEXAXIS", 1, 8, stdout);
    fwrite(head, sizeof *head, 4, stdout);
    for (uint32_t i = 0; i < p; i++) {
        char field[FLEXAXIS_NAME] = {0};
        strncpy(field, names[i], FLEXAXIS_NAME - 1);
        fwrite(field, 1, FLEXAXIS_NAME, stdout);
    }
    fflush(stdout);
    while (fread(&samples, sizeof samples, 1, stdin) == 1 && samples > 0) {
        sample = realloc(sample, 2 * samples * sizeof *sample);
        theta = realloc(theta, p * samples * sizeof *theta);
        if (!sample || !theta) flexaxis_fail("no memory");
        flexaxis_read(sample, 2 * samples * sizeof *sample);
        for (uint64_t k = 0; k < samples; k++)
            step(state, sample[2 * k], sample[2 * k + 1], theta + p * k);
        fwrite(theta, sizeof *theta, p * samples, stdout);
        fflush(stdout); /* without it, the answer would stay in the buffer */
    }
    free(sample);
    free(theta);
}

#endif
