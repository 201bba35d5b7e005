"""The types of settings that functions take by keyword; scripts/write_options.py writes them."""

from typing import Literal, TypedDict


class DetectorOptions(TypedDict, total=False):
    """Fields of `DetectorSettings`."""

    family: str
    family_file: str
    polarity: Literal['auto', 'dark', 'bright']
    min_radius: float
    max_radius: float
    report_undecoded: bool
    command: str
    detector_timeout: float


class IdentificationOptions(DetectorOptions, total=False):
    """Fields of `IdentificationSettings` and of the settings in it, except the detector."""

    expected_targets: int
    estimate_expected: bool
    follow: int
    ahf: bool
    expected_ids: str
    network_ids: str
    fusion: bool
    coarse: bool
    threads: int
    search: Literal['extended', 'published']
    gamma_high_min: float
    gamma_high_max: float
    gamma_high_step: float
    gamma_low_min: float
    gamma_low_max: float
    gamma_low_step: float
    cutoff_min: float
    cutoff_max: float
    exponent_min: float
    log_offset: float
    black_percentile: float
    white_percentile: float
    population: int
    generations: int
    stall: int
    tournament: int
    crossover: float
    mutation: float
    max_evaluations: int
    patience: int
    max_duration: float
    seed: int
