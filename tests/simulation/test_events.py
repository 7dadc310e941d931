"""Events against closed forms: a mass thrown onto a one-sided spring, and forced crossings."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from mrac_design.errors import SimulationError
from mrac_design.layout import Layout
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.simulation.compilation import find_compiler
from mrac_design.simulation.dormand_prince_8 import DORMAND_PRINCE_8
from mrac_design.simulation.engine import CompiledEngine, InterpretedEngine, LlvmEngine
from mrac_design.simulation.lanes import Case, LaneEngine
from mrac_design.simulation.reduction import Reduction
from mrac_design.simulation.run import Recording, RunSettings, run
from mrac_design.simulation.schedule import build_schedule
from mrac_design.simulation.system import ARGUMENT_NAMES, MODES, Event, HybridSystem
from mrac_design.simulation.tableau import DORMAND_PRINCE_5, RK4
from mrac_design.simulation.trajectory import Occurrence, Signal, Trajectory, event_texts

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler here")
pytestmark = needs_compiler

STIFFNESS, PUSH = 800.0, 2.0
START = np.array([0.02, -0.4])
SPRING_VALUES = np.array([STIFFNESS, PUSH])
METHODS = (RK4, DORMAND_PRINCE_5, DORMAND_PRINCE_8)
CONTACT = Event(name="contact", rising="made", falling="lost")


def small_system(
    rate: Callable[..., ca.SX],
    functions: Callable[..., ca.SX] | None,
    events: tuple[Event, ...],
    *,
    states: int = 2,
    sampling_period: float | None = None,
) -> HybridSystem:
    """x' = rate(x, modes, held sample, input, parameters), records the state."""
    layouts = (
        Layout((("x", states),)),
        Layout((("sample", 1), *([(MODES, len(events))] if events else []))),
        Layout((("input", 1),)),
        Layout((("parameters", 2),)),
    )
    arguments = [layout.symbols(name) for layout, name in zip(layouts, "xzvp", strict=True)]
    x, z, v, p = arguments
    given = (x, z[1:], z[0], v, p)

    def function(name: str, result: ca.SX) -> ca.Function:
        return ca.Function(name, arguments, [result], list(ARGUMENT_NAMES), [name])

    return HybridSystem(
        state=layouts[0],
        held=layouts[1],
        inputs=layouts[2],
        parameters=layouts[3],
        outputs=Layout((("x", states), ("sample", 1))),
        rate=function("rate", rate(*given)),
        output=function("output", ca.vertcat(x, z[0])),
        update=None if sampling_period is None else function("update", ca.vertcat(x[0], z[1:])),
        sampling_period=sampling_period,
        events=events,
        event_functions=None if functions is None else function("events", functions(*given)),
    )


def thrown_mass(*, located: bool, sampling_period: float | None = None) -> HybridSystem:
    """ẍ = g − k x in contact (x > 0), ẍ = g above it."""

    def rate(x, modes, sample, v, p):
        spring = modes[0] * p[0] * x[0] if located else ca.fmax(p[0] * x[0], 0)
        return ca.vertcat(x[1], p[1] - spring + v[0])

    if not located:
        return small_system(rate, None, (), sampling_period=sampling_period)
    return small_system(
        rate, lambda x, *_: x[0], (CONTACT,), sampling_period=sampling_period
    )  # fmt: skip


def still(end: float = 1.0) -> PiecewisePolynomial:
    return PiecewisePolynomial(breakpoints=np.array([0.0, end]), coefficients=np.zeros((1, 1, 1)))


def compiled(system: HybridSystem, method=RK4) -> CompiledEngine:
    return CompiledEngine(system, method, input_powers=1, compiler=find_compiler())


def recording_of(
    engine, system, *, step, record_period=0.01, inputs=None, start=START, duration=1.0
) -> Recording:
    return run(
        engine,
        system,
        inputs=inputs or still(),
        parameters=SPRING_VALUES,
        initial_state=start,
        settings=RunSettings(duration=duration, step=step, record_period=record_period),
    )


def closed_form(end: float) -> tuple[np.ndarray, list[float]]:
    """State at `end` and instants of the events before it."""
    w = np.sqrt(STIFFNESS)
    t, (x, v), touching, instants = 0.0, START, True, []
    while True:
        if touching:
            a, b, middle = x - PUSH / STIFFNESS, v / w, PUSH / STIFFNESS
            # middle + R cos(w s − φ) = 0 on its way down
            phase = np.arctan2(b, a) + np.arccos(-middle / np.hypot(a, b))
            lasts = (phase % (2 * np.pi)) / w
        else:
            lasts = -2 * v / PUSH
        s = min(lasts, end - t)
        if touching:
            c, d = np.cos(w * s), np.sin(w * s)
            x, v = middle + a * c + b * d, w * (b * c - a * d)
        else:
            x, v = x + v * s + PUSH * s**2 / 2, v + PUSH * s
        if t + lasts >= end:
            return np.array([x, v]), instants
        t, touching = t + lasts, not touching
        x = 0.0
        instants.append(t)


EXACT, INSTANTS = closed_form(1.0)


def error_of(system: HybridSystem, method, step: float) -> float:
    # A record every 0.2 s: steps are as long as they are said to be.
    recording = recording_of(compiled(system, method), system, step=step, record_period=0.2)
    return float(np.abs(recording.final_state - EXACT).max())


@pytest.mark.parametrize(
    ("method", "step"),
    [(RK4, 1e-3), (DORMAND_PRINCE_5, 1e-3), (DORMAND_PRINCE_8, 0.02)],
    ids=lambda value: getattr(value, "name", str(value)),
)
def test_order_is_kept_across_the_kink(method, step):
    """Slope over a quarter of the step; across the kink without location it is 2 at best."""
    located, crossed = thrown_mass(located=True), thrown_mass(located=False)
    ratio = 2 if method is DORMAND_PRINCE_8 else 4  # of DP8 a quarter is at rounding
    rates = [
        np.log(error_of(system, method, step) / error_of(system, method, step / ratio))
        / np.log(ratio)
        for system in (located, crossed)
    ]
    assert rates[0] > method.order - 0.4
    if method is not DORMAND_PRINCE_8:
        assert rates[1] < method.order - 0.8


def test_the_mode_is_held_during_a_step_or_its_order_is_lost():
    """With the kink inside the rate, stages of the step that ends at it lie beyond it."""

    def rate(x, modes, sample, v, p):
        return ca.vertcat(x[1], p[1] - ca.fmax(p[0] * x[0], 0) + v[0])

    unheld = small_system(rate, lambda x, *_: x[0], (CONTACT,))
    held = error_of(thrown_mass(located=True), DORMAND_PRINCE_8, 0.02)
    assert error_of(unheld, DORMAND_PRINCE_8, 0.02) > 50 * held


def test_location_is_worth_orders_of_magnitude():
    located, crossed = (error_of(thrown_mass(located=on), RK4, 1e-3) for on in (True, False))
    assert located < 2e-9
    assert crossed > 100 * located


@pytest.mark.parametrize(
    ("method", "step"),
    [(RK4, 2e-4), (DORMAND_PRINCE_5, 1e-3), (DORMAND_PRINCE_8, 0.01)],
    ids=lambda value: getattr(value, "name", str(value)),
)
def test_instants_are_those_of_the_closed_form(method, step):
    recording = recording_of(compiled(thrown_mass(located=True), method), thrown_mass(located=True),
                             step=step)  # fmt: skip
    assert [event.change for event in recording.events] == ["lost", "made", "lost"]
    assert [event.time for event in recording.events] == pytest.approx(INSTANTS, abs=1e-10)
    # Records stay where they were: on the grid, and on the closed form there.
    assert np.array_equal(recording.time, 0.01 * np.arange(100))
    exact = np.array([closed_form(t)[0] if t else START for t in recording.time])
    assert np.abs(recording.outputs[:, :2] - exact).max() < 3e-9  # RK4's error at 0.2 ms


@pytest.mark.parametrize("sampling_period", [None, 0.05])
@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_three_machines_locate_alike(method, sampling_period):
    pytest.importorskip("llvmlite")
    system = thrown_mass(located=True, sampling_period=sampling_period)
    c, llvm, casadi = (
        recording_of(engine, system, step=0.01)
        for engine in (
            compiled(system, method),
            LlvmEngine(system, method, input_powers=1),
            InterpretedEngine(system, method, input_powers=1),
        )
    )
    assert len(c.events) == 3
    assert np.array_equal(c.outputs, llvm.outputs)
    assert c.events == llvm.events
    assert [event.rises for event in casadi.events] == [event.rises for event in c.events]
    # CasADi rounds a product before its sum, the others do not.
    times = [[event.time for event in machine.events] for machine in (casadi, c)]
    np.testing.assert_allclose(times[0], times[1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(casadi.outputs, c.outputs, rtol=1e-10, atol=1e-12)


def test_samples_stay_exact_though_steps_end_between_them():
    system = thrown_mass(located=True, sampling_period=0.05)
    recording = recording_of(compiled(system), system, step=1e-3)
    samples = recording.outputs[::5, 2]  # just taken at each of these records
    assert np.array_equal(samples, recording.outputs[::5, 0])


def largest_and_last(size: int) -> Reduction:
    a, y, now = ca.SX.sym("a", 2), ca.SX.sym("y", size), ca.SX.sym("now")
    return Reduction(
        initial=np.zeros(2),
        fold=ca.Function("fold", [a, y, now], [ca.vertcat(ca.fmax(a[0], y[0]), a[1] + y[1])]),
        finish=ca.Function("finish", [a], [a]),
        metrics=("largest", "sum"),
    )


def mass_on_a_moving_surface() -> HybridSystem:
    """ẍ = g − k (x − v) where x > v, the surface v moving."""
    return small_system(
        lambda x, modes, sample, v, p: ca.vertcat(x[1], p[1] - modes[0] * p[0] * (x[0] - v[0])),
        lambda x, modes, sample, v, p: x[0] - v[0],
        (CONTACT,),
    )


@pytest.mark.parametrize("method", [RK4, DORMAND_PRINCE_5, DORMAND_PRINCE_8])
@pytest.mark.parametrize("record_period", [0.01, 0.1])
def test_each_lane_has_the_bits_of_a_run_of_its_own(method, record_period):
    """Events at other instants in every lane, in one none at all."""
    system = mass_on_a_moving_surface()
    cases = [
        Case(
            parameters=SPRING_VALUES * (1 + 0.03 * lane),
            initial_state=START if lane else np.array([PUSH / STIFFNESS, 0.0]),
            inputs=PiecewisePolynomial(
                breakpoints=np.array([0.0, 1.0]), coefficients=np.array([[[0.0, 0.05 * lane]]])
            ),
        )
        for lane in range(8)
    ]
    engines = [
        LaneEngine(
            system, method, largest_and_last(3),
            input_powers=2, compiler=find_compiler(), lanes=lanes,
        )
        for lanes in (8, 1)
    ]  # fmt: skip
    schedule = build_schedule(
        cases[0].inputs, duration=1.0, step=0.02, record_period=record_period,
        sampling_period=None, spanning=engines[0].spanning,
    )  # fmt: skip
    wide, narrow = (engine.accumulate(schedule, cases) for engine in engines)
    assert np.array_equal(wide, narrow)
    assert np.ptp(wide[1:, 1]) > 0.1


def clock(offsets: list[float], *, slope: float = 1.0) -> HybridSystem:
    """x' = 1, with events where x passes the offsets."""
    events = tuple(
        Event(name=f"mark {i}", rising="up", falling="down") for i in range(len(offsets))
    )
    return small_system(
        lambda x, *_: ca.vertcat(slope, 0),
        lambda x, *_: ca.vertcat(*(x[0] - offset for offset in offsets)),
        events,
    )


def marks_of(offsets: list[float], *, step: float = 0.1) -> list[tuple[str, float]]:
    system = clock(offsets)
    recording = recording_of(compiled(system), system, step=step, record_period=0.1,
                             start=np.zeros(2))  # fmt: skip
    assert recording.final_state[0] == pytest.approx(1.0, abs=1e-14)
    return [(event.event.name, event.time) for event in recording.events]


def test_several_events_in_one_step_come_in_their_order():
    names, times = zip(*marks_of([0.271, 0.234, 0.2341]), strict=True)
    assert names == ("mark 1", "mark 2", "mark 0")
    assert times == pytest.approx([0.234, 0.2341, 0.271], abs=1e-11)


def test_events_on_a_grid_point_and_at_the_same_instant_are_met_once():
    names, times = zip(*marks_of([0.3, 0.3]), strict=True)
    assert sorted(names) == ["mark 0", "mark 1"]
    assert times == pytest.approx([0.3, 0.3], abs=1e-11)


def test_an_event_at_the_very_beginning_is_met_once():
    """At 0 the function is not positive; right after, it is."""
    ((name, time),) = marks_of([0.0])
    assert name == "mark 0"
    assert 0 < time < 1e-11


def test_two_changes_within_one_step_are_not_seen():
    """x (0.25 − x)(x − 0.27) grazes zero between steps of 0.1, and is seen with steps of 0.01."""
    system = small_system(
        lambda x, *_: ca.vertcat(1, 0),
        lambda x, *_: (x[0] - 0.25) * (0.27 - x[0]),
        (CONTACT,),
    )
    seen = [
        recording_of(compiled(system), system, step=step, record_period=0.1,
                     start=np.zeros(2)).events
        for step in (0.1, 0.01)
    ]  # fmt: skip
    assert seen[0] == ()
    assert [event.time for event in seen[1]] == pytest.approx([0.25, 0.27], abs=1e-11)


def test_a_jump_of_the_input_is_an_event_at_its_instant():
    """The function v − 0.5 jumps with the input at 0.3137 s, which is on no grid."""
    system = small_system(
        lambda x, modes, *_: ca.vertcat(modes[0], 0),
        lambda x, modes, sample, v, p: v[0] - 0.5,
        (CONTACT,),
    )
    inputs = PiecewisePolynomial(
        breakpoints=np.array([0.0, 0.3137, 1.0]), coefficients=np.array([[[0.0], [1.0]]])
    )
    recording = recording_of(compiled(system), system, step=0.1, inputs=inputs, start=np.zeros(2))
    ((time, rises),) = [(event.time, event.rises) for event in recording.events]
    assert (time, rises) == (0.3137, True)
    assert recording.final_state[0] == pytest.approx(1.0 - 0.3137, abs=1e-14)


def test_chattering_is_one_clear_error():
    """x' = −sign(x) slides along 0: each mode drives into the other."""
    system = small_system(
        lambda x, modes, *_: ca.vertcat(1 - 2 * modes[0], 0), lambda x, *_: x[0], (CONTACT,)
    )
    start = np.array([0.25, 0.0])
    machines = [compiled(system), InterpretedEngine(system, RK4, input_powers=1)]
    pytest.importorskip("llvmlite")
    machines.append(LlvmEngine(system, RK4, input_powers=1))
    for engine in machines:
        with pytest.raises(SimulationError, match=r"t = 0\.25.*contact.*chatters"):
            recording_of(engine, system, step=0.1, start=start)


def test_without_events_no_program_changes():
    """No trace of location in the text where no event is declared."""
    from mrac_design.simulation.program import c_program

    plain = c_program(thrown_mass(located=False), RK4, input_powers=1)
    watched = c_program(thrown_mass(located=True), RK4, input_powers=1)
    for word in ("settle", "travel", "decide", "log"):
        assert word in watched
        assert word not in plain


def told(event: Event, *changes: tuple[float, bool]) -> list[Occurrence]:
    return [Occurrence(time=time, event=event, rises=rises) for time, rises in changes]


def test_few_changes_are_told_one_by_one_and_many_as_share_of_time():
    few = told(CONTACT, (1.0, False), (1.5, True))
    assert event_texts(few, duration=4.0) == ("contact lost 1.000 s, made 1.500 s",)
    many = told(CONTACT, (0.5, True), *((t, t % 2 == 0) for t in range(1, 6)))
    # Lost until 0.5 s, from 1 to 2, 3 to 4 and from 5 s to the end at 6 s: 3.5 of 6 s.
    assert event_texts(many, duration=6.0) == ("contact lost 3 times, 58 % of the time",)


def test_events_go_with_the_dataset():
    system = thrown_mass(located=True)
    recording = recording_of(compiled(system), system, step=1e-3)
    position = Signal(values=recording.outputs[:, :1], unit="m", labels=("x",), description="mass")
    trajectory = Trajectory(
        time=recording.time, signals={"x": position}, engine="any", events=recording.events
    )
    dataset = trajectory.to_xarray()
    assert list(dataset["event"].values) == ["contact lost", "contact made", "contact lost"]
    assert dataset["event_time"].values == pytest.approx(INSTANTS, abs=1e-8)
