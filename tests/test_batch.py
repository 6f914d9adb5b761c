"""Many files side by side: what becomes of the processes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from time import monotonic, sleep

import pytest

BOSS = """
import os, signal
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from vegtool.workers import _in_worker

if __name__ == "__main__":
    spawn = get_context("spawn")
    pool = ProcessPoolExecutor(1, spawn, _in_worker, (spawn.Event(),))
    print(pool.submit(os.getpid).result(), flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="looks for processes in /proc")
def test_workers_end_with_a_process_that_is_killed(tmp_path: Path) -> None:
    script = tmp_path / "boss.py"
    script.write_text(BOSS)
    boss = subprocess.run(
        [sys.executable, str(script)],
        stdout=subprocess.PIPE,  # open for as long as a worker lives
        stderr=subprocess.DEVNULL,
        text=True,
        timeout=60,
    )
    worker = Path("/proc") / boss.stdout.strip()
    until = monotonic() + 30
    while worker.exists() and monotonic() < until:
        sleep(0.05)
    assert not worker.exists()
