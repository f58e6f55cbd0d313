"""Amounts of work are kept for the innermost meter, and for nobody outside of one."""

from __future__ import annotations

from volery.base.metered_work import done, is_metered, metered


def test_amounts_add_up_by_block() -> None:
    done("scan", beams=5)
    assert not is_metered()
    with metered() as work:
        assert is_metered()
        done("scan", beams=3)
        done("scan", beams=4)
        done("slam")
    done("scan", beams=5)
    assert work == {"scan": {"calls": 2, "beams": 7}, "slam": {"calls": 1}}


def test_a_meter_inside_another_keeps_its_own_work() -> None:
    with metered() as outer:
        done("slam")
        with metered() as inner:
            done("scan", beams=2)
        done("slam")
    assert inner == {"scan": {"calls": 1, "beams": 2}}
    assert outer == {"slam": {"calls": 2}}
