"""The cost model: what it counts, and the order of time that a plan makes of it."""

import pytest

from studies import HEAVY_SCENE, parsed
from workflow.cases import arrange
from workflow.plan import plan_study
from workflow.plan._plan import order_of_time
from workflow.solve import model_seconds

TEXT = f"study: a{HEAVY_SCENE}axes: {{h: H, alpha: {{lin: [1, 2, COUNT]}}}}\n"
PLAIN = "output: {interval: 0.1, histories: [], balances: false}\n"


def seconds_of(text: str) -> float:
    return model_seconds(arrange(parsed(text)))


def heavy(count: int, more: str = PLAIN, h: str = "1e-6") -> str:
    return TEXT.replace("H", h, 1).replace("COUNT", str(count)) + more


def test_the_model_counts_what_takes_time() -> None:
    """Whole packs, balances, and the steady rubs of the exact scheme."""
    seven, eight, many = (seconds_of(heavy(count, h="1e-7")) for count in (7, 8, 512))
    assert seven == pytest.approx(eight, rel=3e-3)  # but for the growth rate of one more alpha
    with_balances = seconds_of(heavy(512, PLAIN.replace("false", "true"), "1e-7"))
    assert 1.2 * many < with_balances < 1.5 * many
    exact = heavy(8).replace("h: 1e-6", "scheme: event_driven")
    assert seconds_of(exact.replace("histories", "steady: true, histories")) > seconds_of(exact)


def test_fast_waves_cost_the_exact_scheme_more() -> None:
    """A load harmonic of order 40 asks for forty times the certified steps of the load's own period."""
    exact = heavy(1000).replace("h: 1e-6", "scheme: event_driven, e: 0.5")
    waves = exact.replace("frequency: 20}", "frequency: 20, harmonics: [{order: 40, amplitude: 1}]}\n  speed: 20")
    assert seconds_of(waves) > 5 * seconds_of(exact)


def test_a_plan_says_an_order_of_time() -> None:
    orders = ["seconds", "minutes", "hours", "days"]
    assert [order_of_time(seconds) for seconds in (0.0, 61.0, 7200.0, 1e6)] == orders
    short, long = heavy(8, h="1e-4"), heavy(2048, h="1e-11")
    assert [plan_study(parsed(text)).time for text in (short, long)] == ["seconds", "days"]
    assert plan_study(parsed(f"{short}reference: {{scheme: moreau, h: 1e-11}}\n")).time != "seconds"
