"""The files of fitted weights: what a fit writes into it, with what made it."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ahf_ros.detectors.ring.confidence import WEIGHTS


def write_weights(
    purpose: str,
    seeds: Sequence[int],
    weights: Mapping[str, np.ndarray],
    path: Path = WEIGHTS,
) -> None:
    """Replace one set of a file, and say from which seeds and at which commit it was fitted.

    Parameters
    ----------
    purpose : str
        Name of the set, and of the benchmark that fits it.
    seeds : sequence of int
    weights : mapping of str to ndarray
    path : Path
        The file; that of the ring detector by default.
    """
    sets = json.loads(path.read_text(encoding='utf-8'))
    commit = subprocess.run(
        ['git', 'describe', '--always', '--dirty'],
        cwd=path.parent,
        check=True,
        capture_output=True,
        text=True,
    )
    sets[purpose].update(
        command=f'python -m benchmarks.{purpose} --fit {" ".join(map(str, seeds))}',
        seeds=list(seeds),
        commit=commit.stdout.strip(),
        **{name: values.tolist() for name, values in weights.items()},
    )
    text = json.dumps(sets, indent=2)
    text = re.sub(r'\[\s+([^]]*?)\s+\]', lambda row: f'[{" ".join(row[1].split())}]', text)
    path.write_text(text + '\n', encoding='utf-8')
    print(f'{path}: weights of the {purpose}')
