"""Streams: the same for the same key, unrelated for any other, in any order."""

import numpy as np

from flexaxis.sim.random_draws import stream

KEYS = [("a", 0, "x"), ("b", 0, "x"), ("a", 1, "x"), ("a", 0, "y"), ("a", 10, "x"), ("a1", 0, "x")]


def test_streams_of_different_keys_are_not_correlated():
    draws = np.array([stream(*key).standard_normal(20_000) for key in KEYS])
    correlation = np.corrcoef(draws) - np.eye(len(KEYS))
    # Of unrelated streams it is about 1/sqrt(n) = 0.007.
    assert np.max(np.abs(correlation)) < 0.04


def test_stream_is_the_documented_generator():
    from hashlib import sha256

    key = int(sha256(b"a/7/noise.speed").hexdigest()[:32], 16)
    expected = np.random.Generator(np.random.Philox(key=key)).random(4)
    assert np.array_equal(stream("a", 7, "noise.speed").random(4), expected)
