"""Which face belongs to which branch: told by the file, or recovered from bare geometry.

`branches_of(plant)` gives what the file declares, else `recover_branches(plant)`;
`write_branches(branches, path)` writes the table.
"""

from __future__ import annotations

from vegtool.branches.recover import branches_of, recover_branches
from vegtool.branches.table import write_branches

__all__ = ["branches_of", "recover_branches", "write_branches"]
