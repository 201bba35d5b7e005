"""The formats of other software, and what each of them holds.

The command line lists them before it knows whether it exports anything, so what computes is
imported where it is used.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING

from ahf_ros.interchange.files import write_whole

if TYPE_CHECKING:
    from ahf_ros.interchange.export.survey import Control, MeasuredImage, Survey


@dataclass(frozen=True, slots=True)
class Format:
    """A format.

    Attributes
    ----------
    writer : str
        Module below `ahf_ros` and name of the function that makes the files.
    origin : float
        What is added to our coordinates, px: 0.0 where (0, 0) is the centre of the first pixel,
        0.5 where it is its corner.
    paths : bool
        Whether the format knows images by their paths; if not, their names have to differ.
    control : bool
        Whether the format holds control points.
    """

    writer: str
    origin: float
    paths: bool = False
    control: bool = True

    def files(self, survey: Survey) -> dict[str, bytes]:
        """Return the content of each file of a survey by its path in the folder of the export."""
        made: dict[str, bytes] = resolve_name(f'ahf_ros.{self.writer}')(survey)
        return made


FORMATS: Mapping[str, Format] = {
    'metashape': Format('interchange.export.metashape:metashape_files', 0.5),
    'mmvii': Format('interchange.export.mmvii:mmvii_files', 0.0),
    'colmap': Format('interchange.export.colmap:colmap_files', 0.5, paths=True, control=False),
    'opf': Format('interchange.export.opf:opf_files', 0.5, paths=True),
    'odm': Format('interchange.export.tables:odm_files', 0.0),
    'realitycapture': Format('interchange.export.tables:realitycapture_files', 0.5),
    'csv': Format('interchange.export.tables:csv_files', 0.0, paths=True),
}


@dataclass(frozen=True, slots=True)
class Export:
    """A format and the folder that its files are written to.

    Examples
    --------
    >>> Export.parsed('odm=out/odm').folder.name
    'odm'
    """

    format: str
    folder: Path

    @classmethod
    def parsed(cls, text: str) -> Export:
        """Return the export that a text such as 'odm=out/odm' stands for.

        Raises
        ------
        ValueError
            If it is not like that, or the format is not known.
        """
        name, _, folder = text.partition('=')
        if name not in FORMATS or not folder:
            raise ValueError(
                f'export is {text!r}, accepted is FORMAT=DIR with a format of {", ".join(FORMATS)}'
            )
        return cls(name, Path(folder))

    def check_names(self, paths: Sequence[str]) -> None:
        """Raise a ValueError if the format could not tell two images apart."""
        from ahf_ros.interchange.export.survey import check_names

        if not FORMATS[self.format].paths:
            check_names(paths, self.format)

    def write(
        self, images: Sequence[MeasuredImage], control: Control | None = None
    ) -> tuple[Path, ...]:
        """Write the files of the export.

        Parameters
        ----------
        images : sequence of MeasuredImage
        control : Control, optional

        Returns
        -------
        tuple of Path
            The files; each is complete, and existing ones are replaced.

        Raises
        ------
        ValueError
            If the format cannot hold what is given, or a file cannot be written.
        """
        from ahf_ros.interchange.export.survey import make_survey

        self.check_names([image.path for image in images])
        kind = FORMATS[self.format]
        survey = make_survey(images, control if kind.control else None, kind.origin)
        written = []
        for name, content in kind.files(survey).items():
            path = self.folder / name
            write_whole(path, content)
            written.append(path)
        return tuple(written)
