"""Mutations of a chain on disk: of what HDF5 stores under which name."""

import hashlib
import io
from random import Random
from typing import Any

import numpy as np

from edtk.fit.run_chain import SEAL, SEAL_LENGTH
from tests.fuzz import mutate_text

Array = Any


def mutate_chain(content: bytes, rng: Random) -> bytes:
    """A chain file in which something else is stored, or whose bytes are others."""
    import h5py

    if rng.random() < 0.5:
        return rng.choice(mutate_text.OF_BYTES)(content, rng)
    stored = io.BytesIO(content[:-SEAL_LENGTH])
    with h5py.File(stored, "r+") as file:
        for _ in range(rng.choice((1, 1, 2))):
            _change(file, rng)
    image = stored.getvalue()
    # With a right seal, so that what is behind it is tested too.
    return image + SEAL + hashlib.sha256(image).digest()


def _change(file: Any, rng: Random) -> None:
    """Change one entry: an attribute, an array, or the group."""
    if "mcmc" not in file:
        return
    group = file["mcmc"]
    way = rng.random()
    if way < 0.45 and len(group.attrs):
        name = rng.choice(sorted(group.attrs))
        del group.attrs[name]
        if rng.random() < 0.7:
            group.attrs[name] = _value(rng)
    elif way < 0.9 and len(group):
        name = rng.choice(sorted(group))
        old = group[name][()]
        del group[name]
        if rng.random() < 0.85:
            group[name] = _array(np.asarray(old), rng)
    elif way < 0.95:
        file.move("mcmc", "other")
    else:
        group.attrs["another"] = _value(rng)


def _value(rng: Random) -> Any:
    """An attribute's value of some other type or size."""
    return rng.choice(
        (
            *(-1, 0, 1, 7, 10**6, 2**62, np.nan, np.inf, -1.5, 1e308, True, "", "abc", b"\xff"),
            *(np.zeros(0), np.zeros(3), np.arange(624), np.full((2, 2), np.nan), "ü" * 50),
            *(np.array(["a", "b"], dtype="S1"), np.int8(-3), np.array(5)),
        )
    )


def _array(old: Array, rng: Random) -> Array:
    """An array of another shape, type, or content."""
    way = rng.randrange(9)
    if way == 0:
        return old[: len(old) // 2] if old.ndim else np.zeros(2)
    if way == 1:
        return old.reshape(-1)
    if way == 2:
        return old.astype("S8") if old.size < 1000 else np.array([b"text"])
    if way == 3:
        return np.full(old.shape, rng.choice((np.nan, np.inf, -np.inf, 1e308, 0.0, -1.0)))
    if way == 4:
        return old.astype("f2").astype(rng.choice(("i4", "f4", "u1", "c8")))
    if way == 5:
        return np.zeros((0, *old.shape[1:]))
    if way == 6:
        return old[None]
    if way == 7:
        return np.array(3.0)
    found = old.astype(float).copy()
    if found.size:
        found.flat[rng.randrange(found.size)] = rng.choice((np.nan, np.inf, 1e300))
    return found
