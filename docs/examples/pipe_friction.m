% A flexaxis estimator in GNU Octave 7 or newer: pipe:octave-cli -q docs/examples/pipe_friction.m
%
% It estimates the motor friction f_m with a predictor of the axis and its sensitivity to f_m. It
% knows nothing of flexaxis but the lines of JSON; pipe_friction.py is the same in Python.
1;   % a script, although a function comes first

% Read one line; empty at the end. (fgetl would wait for the line after it as well.)
function content = read_line ()
  try
    content = jsondecode (input ("", "s"));
  catch
    content = [];
  end
end

% The first line says what there is to know; the answer says what is estimated, from which output.
header = read_line ();
T = header.period;
n = header.nominal;
printf ("{\"names\": [\"f_m\"], \"output\": \"speed\"}\n");
fflush (stdout);   % without it the line would wait in a buffer for ever

% x = [twist motor-gear, twist gear-arm, speeds of motor, gear and arm]
r = n.r;
A = [ 0, 0, r, -1, 0
      0, 0, 0, 1, -1
      [-r * n.k_g, 0, -r^2 * n.d_g, r * n.d_g, 0] / n.J_m
      [n.k_g, -n.k_a, r * n.d_g, -n.f_g - n.d_g - n.d_a, n.d_a] / n.J_g
      [0, n.k_a, 0, n.d_a, -n.d_a - n.f_a] / n.J_a ];
B = [0; 0; n.k_T / n.J_m; 0; 0];
dA = zeros (5);   % derivative of A with respect to f_m
dA(3, 3) = -1 / n.J_m;

theta = n.f_m;
low = 0.1 * theta;
high = 10 * theta;
lambda = 0.995;
P = 1e-3 * (1 - lambda);
X = zeros (11, 1);   % sensitivity of x, x, and the input that is held

sample = read_line ();
while ! isempty (sample)
  F = A + theta * dA;
  M = [F, dA, zeros(5, 1); zeros(5), F, B; zeros(1, 11)];
  X = expm (M * T) * X;
  X(11) = sample.u;           % acts from now on
  if ! isempty (sample.y)     % it is [] in a gap
    psi = X(3);
    gain = P * psi / (1 + psi * P * psi);
    theta = min (max (theta + gain * (sample.y - X(8)), low), high);
    P = (1 - gain * psi) * P / lambda;
  end
  printf ("{\"theta\": [%.17g]}\n", theta);   % jsonencode would keep 15 digits only
  fflush (stdout);
  sample = read_line ();
end
