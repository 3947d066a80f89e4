"""Devices on which tests run; those marked ``cuda`` are skipped where there is none."""

from __future__ import annotations

import pytest

DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)]
