"""Campaigns: many runs of a program on lines in virtual time, over scenarios, seeds and parameters (docs/campaign.md).

    python -m servodrome campaign run PLAN.toml --out DIR
    python -m servodrome campaign report DIR
"""

from .check import check_plan
from .plan import Plan, Run, load_plan
from .store import Store
from .work import execute

__all__ = ["Plan", "Run", "Store", "check_plan", "execute", "load_plan"]
