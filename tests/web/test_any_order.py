"""Whatever participants send, in whatever order: the database holds what a simple model says, and no page fails."""

from pathlib import Path

import pytest
from flask import Flask

from tests.faults.replay import nonces_unread, run_machine


def test_whatever_is_sent_in_whatever_order_is_lost_doubled_or_changed_never(app: Flask, instance: Path) -> None:
    assert run_machine(app, instance, num_examples=10, num_steps=40).total() > 100


def test_a_program_that_reads_no_nonces_is_found_out(app: Flask, instance: Path) -> None:
    with nonces_unread(), pytest.raises(AssertionError):
        run_machine(app, instance, num_examples=200, num_steps=40, shrinks=False)
