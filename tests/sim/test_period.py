"""Other sampling periods than 5 ms: the same axis, controller and faults on another grid."""

import numpy as np
import pytest

from flexaxis.sim.errors import ScenarioError
from flexaxis.sim.parameters import preset
from flexaxis.sim.record import Record
from flexaxis.sim.simulate import simulate
from flexaxis.sim.stability import _radius, loop_problem
from flexaxis.sim.streams import stream
from flexaxis.sim.tables.controller import ControllerConfig
from flexaxis.sim.tables.excitation import Moves, Multisine
from flexaxis.sim.tables.faults import Intermittent, Ramp, Step, Thermal
from flexaxis.sim.timing import Grid

from .conftest import commanded, exact_speed

PERIODS = [0.001, 0.002, 0.0025, 0.01]
FAULT = '[[fault]]\nkind = "step"\nparameter = "f_m"\nat = 1.5\nfactor = 1.5\n'


def scenario_at(make, period, text="", **top):
    slow = "controller.Kv = 0.06\n" if period == 0.01 else ""
    return make(f"period = {period}\n{slow}{text}", duration=3.0, **top)


@pytest.mark.parametrize("period", [*PERIODS, 0.005])
@pytest.mark.parametrize("name", ["n1", "n2"])
def test_the_plant_is_equations_3_and_4_sampled_with_that_period(period, name, make):
    scenario = scenario_at(make, period, FAULT, preset=f'"{name}"')
    (record,) = simulate(scenario, [0])
    assert len(record.time) == round(3.0 / period) and record.period == period
    exact = exact_speed(record.torque, scenario.true_parameters(), period)
    # RK4 in steps of 1 ms at most, over some thousands: below 3e-4 as `test_plant` has it.
    error = np.linalg.norm(record.true_speed - exact) / np.linalg.norm(exact)
    assert error < 3e-4
    assert np.array_equal(record.increment[1:], np.diff(record.angle) / period), (
        "the increment is over one sample"
    )


@pytest.mark.parametrize("period", PERIODS)
def test_the_controller_runs_at_that_period(period, make):
    scenario = scenario_at(make, period, "controller.tau = 0.002")
    (record,) = simulate(scenario, [3])
    wanted = scenario.excitation.reference(scenario.grid, stream(scenario.key, 3, "excitation"))
    gains = {name: getattr(scenario.controller, name) for name in ("Kp", "Kv", "Ki", "tau")}
    expected = [*commanded(wanted - record.true_angle_m, period, **gains)]
    np.testing.assert_allclose(record.torque, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("period", PERIODS)
def test_the_excitation_is_the_same_signal_on_another_grid(period):
    """Its lines lie below half of either rate, so both grids hold all of it."""
    common = round(0.01 / period)
    for excitation in (Multisine(pause=((2.0, 4.0),)), Moves()):
        fine = excitation.reference(Grid.first(12 * common * 100, period), np.random.default_rng(5))
        slow = excitation.reference(Grid.first(1200, 0.01), np.random.default_rng(5))
        until = 200 if isinstance(excitation, Multisine) else 1200
        # in a pause the clock stands at the last sample before it, which is another one
        assert fine[::common][:until] == pytest.approx(slow[:until], abs=1e-9)


@pytest.mark.parametrize("period", [*PERIODS, 0.005])
def test_faults_lie_where_their_times_say(period):
    grid = Grid.first(round(8 / period), period)
    after = grid.times >= 2.0 - 1e-9
    common = {"parameter": "f_m", "at": 2.0, "factor": 1.5}
    assert np.array_equal(Step(**common).factor_at(grid), np.where(after, 1.5, 1.0))
    # the factor of a sample is the mean of the curve over it
    middle = grid.times + period / 2
    ramp = 1 + 0.5 * np.clip((middle - 2.0) / 3.0, 0, 1) * after
    assert Ramp(**common, over=3.0).factor_at(grid) == pytest.approx(ramp, abs=1e-9)
    decayed = np.exp(-np.maximum(grid.times - 2.0, 0))
    mean = decayed * (1 - np.exp(-period)) / period
    warm = Thermal(**common, time_constant=1.0)
    assert warm.factor_at(grid) == pytest.approx(np.where(after, 1.5 - 0.5 * mean, 1), abs=1e-9)
    assert warm.onsets(grid) == [(round(2 / period), round(42 / period))]
    to_and_fro = Intermittent(**common, on=1.0, off=0.5, until=6.0)
    phase = np.mod(np.round((grid.times - 2.0) / period).astype(int), round(1.5 / period))
    faulty = after & (phase < round(1 / period)) & (grid.times < 6.0 - 1e-9)
    assert np.array_equal(to_and_fro.factor_at(grid), np.where(faulty, 1.5, 1.0))


def test_events_are_at_the_sample_of_that_grid(make):
    (event,) = scenario_at(make, 0.002, FAULT).events()
    assert event.index == 750 and event.after == pytest.approx(1.5 * event.before, rel=1e-15)


def test_5_ms_is_what_scenarios_without_the_key_have(make):
    silent, said, other = (
        make(duration=3),
        make("period = 0.005", duration=3),
        make("period = 0.0025", duration=3),
    )
    for identity in ("hash", "key", "record_hash"):
        assert getattr(silent, identity) == getattr(said, identity) != getattr(other, identity)
    assert silent.resolved()["period"] == 0.005


@pytest.mark.parametrize(("period", "late"), [(0.002, 0.001), (0.01, 0.003), (0.01, 0.012)])
def test_a_torque_delay_goes_by_ms_at_any_period(period, late, make):
    scenario = scenario_at(make, period, f"delay.torque = {late}\n")
    (record,) = simulate(scenario, [0])
    ticks = round(period / 0.001)
    acting = np.repeat(record.torque, ticks)
    acting = np.concatenate([np.zeros(round(late / 0.001)), acting])[: len(acting)]
    exact = exact_speed(acting, [np.array([*scenario.nominal.values()])] * len(acting), 0.001)[
        ::ticks
    ]
    error = np.linalg.norm(record.true_speed - exact) / np.linalg.norm(exact)
    assert error < 3e-4


def test_a_filter_and_an_inner_loop_know_the_period(make):
    scenario = scenario_at(make, 0.002, "filter.speed = 0.004\nnoise.speed = 0.0\n")
    (record,) = simulate(scenario, [0])
    a, out = np.exp(-0.002 / 0.004), 0.0
    for k, value in enumerate(record.true_speed):
        out = a * out + (1 - a) * value
        assert record.speed[k] == pytest.approx(out, abs=1e-12)
    inner = [
        simulate(scenario_at(make, T, 'controller.rate = 1000\nexcitation.kind = "standstill"\n'
                             'noise.speed = 0.0\n'), [0])[0]
        for T in (0.002, 0.01)
    ]  # fmt: skip
    assert not inner[0].torque.any() and not inner[1].torque.any()


def test_an_unstable_loop_is_refused_with_a_gain_that_would_do(make):
    with pytest.raises(ScenarioError, match="unstable on the nominal axis") as caught:
        make("period = 0.01\ncontroller.Kv = 0.3", duration=3)
    allowed = float(str(caught.value).split("Kv up to ")[1].split()[0])
    (record,) = simulate(make(f"period = 0.01\ncontroller.Kv = {allowed}", duration=30), [0])
    assert np.abs(record.true_speed).max() < 1e3
    assert allowed == pytest.approx(0.232, rel=0.02)  # a scan of the eigenvalues, apart from this


@pytest.mark.parametrize(("ticks", "late"), [(0, 0), (12, 0), (0, 2)])
def test_the_gain_that_would_do_is_about_the_largest(ticks, late):
    def said(Kv):
        delays = {"torque_ticks": ticks, "late": late}
        return loop_problem(preset("n1"), ControllerConfig(Kv=Kv), 0.01, **delays)

    allowed = float(said(0.6).split("Kv up to ")[1].split()[0])
    assert said(allowed) is None and said(1.03 * allowed)


@pytest.mark.parametrize(
    ("period", "ticks", "late", "Kv"),
    [(0.002, 0, 0, 0.9), (0.005, 3, 0, 0.2), (0.005, 0, 2, 0.07), (0.01, 12, 0, 0.06)],
)
def test_growth_is_that_of_the_simulated_loop(period, ticks, late, Kv, make):
    """From a pulse of noise on, the loop dies away as its slowest mode does, or grows."""
    for factor in (1.0, 2.5):
        config = ControllerConfig(Kv=factor * Kv)
        stable = loop_problem(preset("n1"), config, period, torque_ticks=ticks, late=late) is None
        growth = _radius(preset("n1"), config, period, ticks, late)
        found = _measured_growth(config, period, ticks, late)
        assert found == pytest.approx(growth, rel=2e-3), factor
        assert stable == (found < 1)


def _measured_growth(config, period, ticks, late):
    """Step plant and controller from a kick on, and fit the growth of the angles' size."""
    from flexaxis.sim.plant.plant import Plant
    from flexaxis.sim.tables.controller import Controller

    each = round(period / 0.001)
    plant = Plant([preset("n1")], period=0.001, substeps=1)
    controller = Controller(config, 1, period=period)
    torques, angles, sizes = [np.zeros(1)] * ticks, [], []
    kick = 1e-30  # so that growth has room
    for k in range(4000):
        angles.append(plant.angle_m.copy())
        seen = angles[k - late] if k >= late else np.zeros(1)
        u = controller.torque(np.array([kick if k == 0 else 0.0]), seen)
        for _ in range(each):
            torques.append(u)
            plant.step(torques.pop(0))
        sizes.append(np.linalg.norm(plant.angles))
        if sizes[-1] > 1e-2:
            break
    return _rate(np.array(sizes))


def _rate(sizes):
    """Return the growth per sample over the second half."""
    k = np.arange(len(sizes))[len(sizes) // 2 :]
    return np.exp(np.polyfit(k, np.log(sizes[k]), 1)[0])


def test_a_record_knows_its_period():
    for period in (0.001, 0.0025, 0.005, 0.01, 1 / 300, 0.0123):
        time = 0.3 + np.arange(1000) * period
        record = Record(time=time, torque=np.zeros(1000), speed=np.zeros(1000))
        assert record.period == pytest.approx(period, rel=1e-12)
    assert Record(time=np.arange(100) / 500, torque=time[:100], speed=time[:100]).period == 0.002
