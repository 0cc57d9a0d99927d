from vobench.trajectory.nanoseconds import NS_PER_MS, NS_PER_S


def test_a_second_has_a_thousand_milliseconds_of_a_million_nanoseconds() -> None:
    assert NS_PER_S == 1000 * NS_PER_MS
    assert NS_PER_MS == 10**6
    assert isinstance(NS_PER_S, int)
    assert isinstance(NS_PER_MS, int)
