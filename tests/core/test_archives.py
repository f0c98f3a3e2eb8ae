"""Archives of numbers."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from shaftline.core.archives import (
    ArchiveError,
    pack_tree,
    read_archive,
    unpack_tree,
    write_archive,
)


def test_a_tree_comes_back(tmp_path: Path) -> None:
    tree: Any = {
        "state": {0: {"step": torch.tensor(3.0), "mean": np.arange(4.0)}, 1: {}},
        "groups": [
            {"lr": 3e-4, "betas": (0.9, 0.999), "fused": None, "params": [0, 1], "ok": True}
        ],
        "name": "Adam",
    }
    write_archive(tmp_path / "a.npz", pack_tree(tree))
    found = unpack_tree(read_archive(tmp_path / "a.npz"))
    assert found["state"][0]["step"] == 3.0
    assert found["state"][0]["mean"].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert found["state"][1] == {}
    assert found["groups"] == tree["groups"]
    assert isinstance(found["groups"][0]["betas"], tuple)
    assert found["name"] == "Adam"


def test_what_is_no_number_is_not_packed() -> None:
    with pytest.raises(TypeError, match="PosixPath"):
        pack_tree({"here": Path("/tmp")})


def test_a_zip_bomb_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "bomb.npz"
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file,
        file.open("a.npy", "w") as member,
    ):
        for _ in range(300):
            member.write(bytes(1_000_000))
    assert path.stat().st_size < 1e6
    with pytest.raises(ArchiveError, match="unpacks to 300 MB"):
        read_archive(path)


@pytest.mark.parametrize("content", [b"", b"text", b"PK\x03\x04 damaged", bytes(100)])
def test_other_files_are_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "file.npz"
    path.write_bytes(content)
    with pytest.raises(ArchiveError, match="not a NumPy archive of numbers"):
        read_archive(path)


@pytest.mark.parametrize("text", [None, b"{", b'{"array": "none"}'])
def test_other_arrays_are_no_tree(text: bytes | None) -> None:
    tree = {} if text is None else {"skeleton": np.frombuffer(text, np.uint8)}
    with pytest.raises(ArchiveError, match="does not contain a stored tree"):
        unpack_tree(tree)
