"""State estimate and wind of the simulated vehicle, as the demo and the benchmark take them."""

import argparse

from dfvs_sim.demo.options import Conditions, add_condition_options, conditions_from


def args(*words):
    parser = argparse.ArgumentParser()
    add_condition_options(parser)
    return parser.parse_args(words)


def test_a_real_estimate_is_the_default():
    assert conditions_from(args()) == Conditions("medium", "calm")
    assert conditions_from(args("--estimate", "low", "--wind=-1,2")) == Conditions("low", "-1,2")
