% A flexaxis estimator in GNU Octave (7 or newer), which estimates the motor friction f_m.
%
%     flexaxis check 'pipe:octave-cli -q my_estimator.m'
%
% The program predicts the states of the axis and their sensitivities to f_m. Replace this method by
% your own method.
1;   % this statement makes the file a script, although functions follow

function values = take (count, type)
  values = fread (stdin, count, type, 0, "ieee-le");
  if numel (values) < count
    exit (0);   % the run has ended
  end
end

function give (values, type)
  fwrite (stdout, values, type, 0, "ieee-le");
end

function name = take_name ()
  field = char (take (32, "uint8")');
  name = field(1 : find ([field, 0] == 0, 1) - 1);
end

% Read the description of the axis.
magic = char (take (8, "uint8")');
known = take (2, "uint32");
if ! strcmp (magic, "FLEXAXIS") || any (known' != [1, 16909060])   % 0x01020304
  error ("stdin is not from flexaxis, or uses a different protocol version");
end
T = take (1, "double");
counts = take (3, "uint32");   % output, nominal values, names
n = struct ();
for i = 1 : counts(2)
  name = take_name ();
  n.(name) = take (1, "double");
end
for i = 1 : counts(3)
  take_name ();   % parameters that the scenario identifies
end

% Send the name of the estimated parameter and the signal that the program uses (0 is the speed).
give ("FLEXAXIS", "uint8");
give ([1, 16909060, 1, 0], "uint32");
give ([double("f_m"), zeros(1, 29)], "uint8");
fflush (stdout);

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
X = zeros (11, 1);   % sensitivities of x, the states x, and the last input
M = zeros (11);

while true
  count = take (1, "uint64");   % number of samples that follow
  samples = reshape (take (2 * count, "double"), 2, count);
  found = zeros (1, count);
  for k = 1 : count
    F = A + theta * dA;
    M(1:5, 1:5) = F;
    M(1:5, 6:10) = dA;
    M(6:10, 6:10) = F;
    M(6:10, 11) = B;
    X = expm (M * T) * X;
    X(11) = samples(1, k);           % u acts from now on
    if ! isnan (samples(2, k))       % y is NaN in a gap
      psi = X(3);
      gain = P * psi / (1 + psi * P * psi);
      theta = min (max (theta + gain * (samples(2, k) - X(8)), low), high);
      P = (1 - gain * psi) * P / lambda;
    end
    found(k) = theta;
  end
  give (found, "double");
  fflush (stdout);   % without this call, the answer would remain in the buffer
end
