"""A model that tiles share, with the files that it is made of."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from vegtool.formats.shared_model import SharedModel, model_files, plain_name, read_shared
from vegtool.plant import Plant


@dataclass(frozen=True, eq=False)
class Written(SharedModel):
    """files: by their names."""

    files: dict[str, bytes] = field(default_factory=dict)


def shared_model(plant: Plant, name: str, folder: str) -> Written:
    """As instances refer to it, and its files, which were written to be read."""
    files = model_files(plant, name)
    with TemporaryDirectory() as place:
        for file, data in files.items():
            (Path(place) / file).write_bytes(data)
        read = read_shared(Path(place) / f"{plain_name(name)}.gltf", folder)
    return Written(read.name, read.objects, read.uri, read.length, files)
