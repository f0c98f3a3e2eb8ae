"""NumPy's ``default_rng(seed).random(n)`` inside kernels, bit for bit.

A NumPy generator takes longer to create than a whole sea takes to compute, and kernels cannot create
one. So its seeding (SeedSequence: O'Neill's ``seed_seq`` with NumPy's constants) and its stream (PCG64,
XSL-RR 128/64, O'Neill 2014, "PCG: A family of simple fast space-efficient statistically good algorithms
for random number generation") are implemented here. NumPy guarantees that both stay unchanged.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .compiled import compiled

_U32, _U64 = np.uint32, np.uint64
_LOW = _U64(0xFFFFFFFF)
_POOL_START, _POOL_FACTOR = _U32(0x43B0D7E5), _U32(0x931E8875)
_STATE_START, _STATE_FACTOR = _U32(0x8B51F9DD), _U32(0x58F38DED)
_MIX_LEFT, _MIX_RIGHT = _U32(0xCA01F9DD), _U32(0x4973F715)
_SHIFT = _U32(16)
_FACTOR_HIGH, _FACTOR_LOW = _U64(2549297995355413924), _U64(4865540595714422341)
_POOL = 4


@compiled
def _hashed(
    value: np.uint32, constant: np.uint32, factor: np.uint32
) -> tuple[np.uint32, np.uint32]:
    """Hash a word; return it and the constant for the next one."""
    value = _U32(value ^ constant)
    constant = _U32(constant * factor)
    value = _U32(value * constant)
    return _U32(value ^ (value >> _SHIFT)), constant


@compiled
def _multiply(a: np.uint64, b: np.uint64) -> tuple[np.uint64, np.uint64]:
    """Return high and low half of the product of two 64-bit numbers."""
    half = _U64(32)
    a_high, a_low, b_high, b_low = a >> half, a & _LOW, b >> half, b & _LOW
    low = a_low * b_low
    middle = a_high * b_low + (low >> half)
    other = a_low * b_high + (middle & _LOW)
    return a_high * b_high + (middle >> half) + (other >> half), a * b


@compiled
def _step(
    high: np.uint64, low: np.uint64, add_high: np.uint64, add_low: np.uint64
) -> tuple[np.uint64, np.uint64]:
    """Step the linear congruential generator of 128 bits under PCG64."""
    carried, product = _multiply(low, _FACTOR_LOW)
    carried = _U64(carried + high * _FACTOR_LOW + low * _FACTOR_HIGH)
    following = _U64(product + add_low)
    carry = _U64(1) if following < product else _U64(0)
    return _U64(carried + add_high + carry), following


@compiled
def _seeded(seed: int) -> NDArray[np.uint64]:
    """Return the four 64-bit words that NumPy's SeedSequence generates from a seed below 2**32."""
    pool = np.zeros(_POOL, np.uint32)
    pool[0] = _U32(seed)
    constant = _POOL_START
    for i in range(_POOL):
        pool[i], constant = _hashed(pool[i], constant, _POOL_FACTOR)
    for source in range(_POOL):
        for target in range(_POOL):
            if source != target:
                word, constant = _hashed(pool[source], constant, _POOL_FACTOR)
                mixed = _U32(_U32(_MIX_LEFT * pool[target]) - _U32(_MIX_RIGHT * word))
                pool[target] = mixed ^ (mixed >> _SHIFT)
    words = np.zeros(4, np.uint64)
    constant = _STATE_START
    for i in range(2 * _POOL):
        word, constant = _hashed(pool[i % _POOL], constant, _STATE_FACTOR)
        words[i // 2] |= _U64(word) << _U64(32 * (i % 2))
    return words


@compiled
def fill_uniform(seed: int, found: NDArray[np.float64]) -> None:
    """Fill an array with ``numpy.random.default_rng(seed).random(len(found))``; seed < 2**32."""
    words = _seeded(seed)
    one = _U64(1)
    add_high, add_low = (words[2] << one) | (words[3] >> _U64(63)), (words[3] << one) | one
    high, low = _step(_U64(0), _U64(0), add_high, add_low)
    low = _U64(low + words[1])
    high = _U64(high + words[0] + (one if low < words[1] else _U64(0)))
    high, low = _step(high, low, add_high, add_low)
    for k in range(len(found)):
        high, low = _step(high, low, add_high, add_low)
        turn = high >> _U64(58)
        mixed = high ^ low
        bits = (mixed >> turn) | (mixed << ((_U64(64) - turn) & _U64(63)))
        found[k] = float(bits >> _U64(11)) * (1.0 / 9007199254740992.0)
