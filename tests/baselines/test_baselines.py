from __future__ import annotations

import json
import subprocess
import sys

import pytest
from surfaces import cards

from vegtool.baselines import BASELINES, baseline


@pytest.mark.gl
@pytest.mark.parametrize("name", [n for n in BASELINES if n != "gltfpack"])
def test_every_baseline_can_be_made(name: str) -> None:
    made = baseline(cards(50), name, 20)
    assert made.name == name and made.missing == ""
    assert made.level is not None
    assert made.triangles > 0 and (made.texels > 0 or BASELINES[name].budgeted)


def test_the_list_loads_nothing_heavy() -> None:
    code = "import sys, json, vegtool.baselines; print(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.split(".")[0] for name in json.loads(done.stdout)}
    assert not loaded & {"fast_simplification", "moderngl", "scipy", "PIL"}
