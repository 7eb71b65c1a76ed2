"""Every mistake in a scenario, and the one line that answers it."""

import pytest

from flexaxis.sim.errors import ScenarioError
from flexaxis.sim.scenario import parse_scenario

FAULT = '[[fault]]\nkind = "step"\nparameter = "f_m"\nat = 10.0\nfactor = 1.5\n'
TWELVE = "k_T, J_m, J_g, J_a, k_g, k_a, d_g, d_a, f_m, f_g, f_a, r"
LAWS = "f_c, f_s, v_s, sigma_0, sigma_1, alpha, beta, kappa, gap"
CHANGEABLE = TWELVE.replace("r", LAWS)

LATE = FAULT.replace("10.0", "25").replace("fault", "nuisance")

KINDS = ["step", "ramp", "thermal", "intermittent", "profile"]
TO_ZERO = [
    FAULT.replace("1.5", "0.0"),
    FAULT.replace("1.5", "0").replace("step", "ramp") + "over = 2\n",
    FAULT.replace("1.5", "0").replace("step", "thermal") + "time_constant = 2\n",
    FAULT.replace("1.5", "0").replace("step", "intermittent") + "on = 2\noff = 1\n",
    FAULT.replace("1.5", "0").replace("step", "profile") + "points = [[1.0, 1.0]]\n",
]

# text put into a good scenario (None as first key: instead of it) -> the one line expected
CASES = [
    # unknown words, with the nearest right one
    ("presett = 'n1'", "presett: unknown key 'presett'; known keys are", " Did you mean 'preset'?"),
    ("preset = 'N2'", "preset: unknown preset 'N2'; known presets are n1, n2, wg, ", ""),
    ("parameters.Jm = 1.0",
     f"parameters.Jm: unknown parameter 'Jm'; known parameters are {TWELVE}.",
     " Did you mean 'J_m'?"),
    ("identify = ['k_t']", "identify[0]: unknown parameter 'k_t'; ", " Did you mean 'k_T'?"),
    ("identify = ['k_T', '1/Ja']", "identify[1]: unknown parameter '1/Ja'; ",
     " Did you mean '1/J_a'?"),
    ("noise.sped = 0.1", "noise.sped: unknown key 'sped'; known keys are speed, angle, torque.",
     " Did you mean 'speed'?"),
    ("controller.kp = 3",
     "controller.kp: unknown key 'kp'; known keys are Kp, Kv, Ki, tau, rate, log, adapt.",
     " Did you mean 'Kp'?"),
    ("excitation.kind = 'multisin'",
     "excitation: unknown kind 'multisin'; known kinds are multisine, moves, standstill.",
     " Did you mean 'multisine'?"),
    (FAULT.replace("step", "stepp"),
     "fault[0]: unknown kind 'stepp'; known kinds are step, ramp, thermal, intermittent, "
     "profile.",
     " Did you mean 'step'?"),
    (FAULT.replace("f_m", "fm"),
     f"fault[0].parameter: unknown parameter 'fm'; known parameters are {CHANGEABLE}.",
     " Did you mean 'f_m'?"),
    (FAULT.replace("factor", "facter"), "fault[0].factor: is missing",
     "fault[0].facter: unknown key 'facter'; known keys are kind, parameter, at, factor."
     " Did you mean 'factor'?"),
    (FAULT.replace("kind", "#"), "fault[0]: the key `kind` is missing; known kinds are step", ""),
    # wrong types
    ("start = '1.2'", "start: must be a valid number, not '1.2'", ""),
    ("identify = 'k_T'", "identify: must be an array, not 'k_T'", ""),
    ("identify = []", "identify: the array must have at least one entry, not []", ""),
    ("fault = 3", "fault: must be an array, not 3", ""),
    # impossible values
    ("parameters.J_m = -1.2e-3", "parameters.J_m: must be positive [kg m^2], not -0.0012", ""),
    ("parameters.r = 118", "parameters.r: the gear ratio (gear angle over motor angle) "
     "must be in (0, 1], not 118", ""),
    ("parameters.k_g = inf", "parameters.k_g: must be a finite number, not inf", ""),
    ("start = 0", "start: must be greater than or equal to 0.01, not 0", ""),
    ("output = 'arm'", "output: must be 'speed', 'increment' or 'angle', not 'arm'", ""),
    ("noise.speed = -0.1", "noise.speed: must be greater than or equal to 0, not -0.1", ""),
    ("encoder.counts = 16", "encoder.counts: 16 counts per revolution are too few",
     "if you meant 16 bits, give 65536 counts"),
    ("identify = ['k_T', '1/k_T']", "identify[1]: '1/k_T' repeats 'k_T': name each parameter once",
     ""),
    (FAULT.replace("10.0", "20.0"),
     "fault[0].at: the onset at 20 s must be before the end of the run at 20 s", ""),
    (FAULT.replace("step", "profile").replace("10.0", "19.995") + "points = [[1.0, 1.0]]",
     "fault[0].at: the onset at 19.995 s must be before the end of the run at 20 s", ""),
    (FAULT.replace("10.0", "0"), "fault[0].at: must be greater than 0, not 0", ""),
    (FAULT.replace("10.0", "0.004"),
     "fault[0].at: a time must be at least one sample (0.005 s), not 0.004", ""),
    (FAULT.replace("f_m", "J_a").replace("1.5", "0"),
     "fault[0].factor: a factor of 0 is not allowed, because J_a must remain positive", ""),
    (FAULT.replace("1.5", "150"), "fault[0].factor: must be less than or equal to 100, not 150",
     ""),
    (FAULT.replace("1.5", "-0.5"), "fault[0].factor: must be greater than or equal to 0", ""),
    (FAULT.replace("step", "intermittent") + "on = 1\noff = 0.001",
     "fault[0].off: a time must be at least one sample (0.005 s), not 0.001", ""),
    (FAULT.replace("step", "intermittent") + "on = 1\noff = 1\nuntil = 9",
     "fault[0].until: the end at 9 s must be after the onset at 10 s", ""),
    (FAULT.replace("step", "profile") + "points = [[1, 0.5], [1, 1]]",
     "fault[0].points: corner times must increase; 1 s follows 1 s; for", ""),
    (FAULT.replace("step", "profile") + "points = [[0.001, 0.5], [1, 1]]",
     "fault[0].points[0]: a corner must be at least one sample (0.005 s) after the previous", ""),
    ("excitation = { kind = 'multisine', low = 40 }",
     "excitation: no multiple of 1/period = 0.1 Hz lies between low = 40 Hz and", ""),
    ("excitation = { kind = 'multisine', high = 100 }",
     "excitation.high: the frequency must be below 100 Hz, half the sampling rate", ""),
    ("excitation = { kind = 'multisine', period = 3.333 }",
     "excitation.period: must be a multiple of the sampling period (5 ms)", ""),
    ("excitation = { kind = 'multisine', pause = [[5, 4]] }",
     "excitation.pause: each pause must end after its start", ""),
    ("excitation = { kind = 'multisine', pause = [[25, 30]] }",
     "excitation.pause[0]: the pause begins at 25 s, after the end of the run", ""),
    ("period = 0.02", "period: the sampling period must be between 0.001 and 0.01 s, not 0.02", ""),
    ("period = 0.003", "period: one second must be a multiple of the sampling period: use "
     "0.003003 s (333 Hz), not 0.003", ""),
    ("period = 0.0025\ndelay.torque = 0.001", "delay.torque: needs a sampling period that is a "
     "multiple of 1 ms, not 2.5 ms", ""),
    ("period = 0.01\ncontroller.Kv = 0.5", "controller.Kv: the control loop with the "
     "nominal axis is unstable for Kv = 0.5 and a sampling period of 10",
     "Lower controller.Kv, or check controller.Kp, controller.Ki and the delays"),
    ("delay.torque = 0.0015", "delay.torque: the torque delay must be a multiple of 0.001 s", ""),
    ("controller.log = 'mean'", "controller.log: `log` needs an inner control loop: set ", ""),
    ("feedback = 'measured'\ncontroller.rate = 1000", "controller.rate: an inner control loop "
     "cannot read the measured angle", ""),
    ("known.J_a = 1.1", "known.J_a: J_a is estimated: remove this key, and set the "
     "initial value by `start`", ""),
    ("known.Jg = 1.1", "known.Jg: unknown parameter 'Jg'; ", " Did you mean 'J_g'?"),
    (FAULT.replace("fault", "nuisance").replace("10.0", "20.0"),
     "nuisance[0].at: the onset at 20 s must be before the end of the run at 20 s", ""),
    (FAULT.replace("f_m", "coulomb"),
     "fault[0].parameter: the plant has no parameter f_c: add the table friction or lugre", ""),
    (FAULT.replace("f_m", "f_s"),
     "fault[0].parameter: the plant has no parameter f_s: add the ", ""),
    ("stiffening.gear = 1e4\n" + FAULT.replace("f_m", "kappa"),
     "fault[0].parameter: kappa in the table stiffening cannot change during a run", ""),
    ("identify = ['k_T', 'f_c']", "identify[1]: the plant has no parameter f_c: add the table", ""),
    ("friction.coulomb = 0.1\nidentify = ['f_c', 'f_c']",
     "identify[1]: 'f_c' repeats 'f_c': name each parameter once", ""),
    ("friction.coulomb = 0.1\nidentify = ['1/f_c']", "identify[0]: unknown parameter '1/f_c';", ""),
    ("friction.coulomb = 0.1\nload_friction = { f_c = 0.05, load = 0.1 }\nidentify = ['f_c']",
     "identify[0]: f_c is ambiguous: keep only one of the tables friction and load_friction", ""),
    # a value of 0 that makes a percentage or an inverse infinite
    ("identify = ['f_m', '1/d_g']\nparameters.d_g = 0.0",
     "identify[1]: '1/d_g' cannot be estimated while parameters.d_g is 0, because the "
     "estimation error is given in % of this value",
     ""),
    *((f"identify = ['1/f_m']\n{fault}",
       "fault[0].factor: a factor of 0 is not allowed, because 1/f_m is estimated and would "
       "become infinite", "") for fault in TO_ZERO),
    (f"identify = ['1/f_m']\n{TO_ZERO[0]}".replace("[[fault", "[[nuisance"),
     "nuisance[0].factor: a factor of 0 is not allowed, because 1/f_m is estimated", ""),
    ("streams = 'planet'", 'streams: `streams` must be "plant", "content", or the `key` of a',
     " (64 hex digits), not 'planet'"),
    ("difficulty = 'easi'", "difficulty: must be 'easy', 'medium' or 'hard', not 'easi'", ""),
]  # fmt: skip


@pytest.mark.parametrize(("text", "begin", "end"), CASES, ids=[case[1][:40] for case in CASES])
def test_each_mistake_has_its_line(text, begin, end):
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(f'name = "x"\nduration = 20\n{text}\n', source="my.toml")
    lines = str(caught.value).splitlines()
    assert lines[0].startswith(f"my.toml: {begin}"), lines
    assert lines[-1].endswith(end), lines
    # One line for one mistake; only a key written wrongly is also a key missing.
    assert len(lines) == (2 if "is missing" in begin and "facter" in text else 1), lines


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "my.toml: name: is missing"),
        ('name = "two words"\nduration = 20', "my.toml: name: a name must not contain blanks"),
        ('name = "a/b"\nduration = 20', "my.toml: name: a name must not"),
        ('name = "x"\nduration = -1', "my.toml: duration: must be greater than 0, not -1"),
        ('name = "x"\nduration = 200_000', "my.toml: duration: must be less than or equal to 864"),
        ('name = "x\nduration = 20', "my.toml: not valid TOML: Illegal character"),
        ('name = "x"\nname = "y"', "my.toml: not valid TOML: Cannot overwrite a value"),
    ],
)
def test_mistakes_at_the_top(text, line):
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(text, source="my.toml")
    assert str(caught.value).splitlines()[0].startswith(line)


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        (
            f"strat = 1.2\nstart = 0\n{FAULT.replace('10.0', 'true')}",
            ["fault[0].at", "start", "strat"],
        ),
        (
            f'preset = "n3"\nidentify = ["k_T", "k_T"]\n{FAULT.replace("10.0", "25")}{LATE}',
            ["fault[0].at", "identify[1]", "nuisance[0].at", "preset"],
        ),
    ],
)
def test_all_mistakes_are_told_at_once(text, keys):
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(f'name = "x"\nduration = 20\n{text}', source="my.toml")
    assert sorted(line.split(": ")[1] for line in caught.value.problems) == keys


@pytest.mark.parametrize("fault", TO_ZERO, ids=KINDS)
@pytest.mark.parametrize("name", ["d_g", "d_a", "f_m", "f_g", "f_a", "coulomb", "f_c"])
def test_what_may_be_zero_may_become_zero(fault, name):
    text = 'name = "x"\nduration = 20\nfriction.coulomb = 0.1\nidentify = ["k_T", "f_m"]\n'
    (event, *_) = parse_scenario(text + fault.replace("f_m", name)).events()
    assert event.parameter == name.replace("coulomb", "f_c")
    assert event.after == pytest.approx(0, abs=1e-15 * event.before)


@pytest.mark.parametrize("fault", TO_ZERO, ids=KINDS)
@pytest.mark.parametrize("name", ["k_T", "J_m", "J_g", "J_a", "k_g", "k_a"])
def test_what_must_stay_positive_may_not(fault, name):
    with pytest.raises(
        ScenarioError,
        match=rf"fault\[0\].factor: a factor of 0 is not allowed, because {name} must",
    ):
        parse_scenario('name = "x"\nduration = 20\n' + fault.replace("f_m", name))
