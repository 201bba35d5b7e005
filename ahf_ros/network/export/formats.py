"""The formats of other software, and what each of them holds.

The command line lists them before it knows whether it exports anything, so what computes is
imported where it is used.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Literal

from ahf_ros.base.writing import write_files

if TYPE_CHECKING:
    from ahf_ros.network.export.survey import Control, MeasuredImage
    from ahf_ros.network.solution import Solution


@dataclass(frozen=True, slots=True)
class Format:
    """A format: what makes its files, and what they hold.

    `writer` is the module below `ahf_ros` and the name of the function that returns the content of
    each file by its path in the folder of the export. `origin` is what is added to our
    coordinates, px: 0.0 where (0, 0) is the centre of the first pixel, 0.5 where it is its corner.
    `paths` says whether the format knows images by their paths; if not, their names have to
    differ. `control` says whether it holds control points.
    """

    writer: str
    origin: float
    paths: bool = False
    control: bool = True


FORMATS: Mapping[str, Format] = {
    'metashape': Format('network.export.xml_files:metashape_files', 0.5),
    'mmvii': Format('network.export.xml_files:mmvii_files', 0.0),
    'colmap': Format('network.export.colmap:colmap_files', 0.5, paths=True, control=False),
    'opf': Format('network.export.opf:opf_files', 0.5, paths=True),
    'odm': Format('network.export.tables:odm_files', 0.0),
    'realitycapture': Format('network.export.tables:realitycapture_files', 0.5),
    'csv': Format('network.export.tables:csv_files', 0.0, paths=True),
}


@dataclass(frozen=True, slots=True)
class NetworkFormat:
    """A format of an adjusted network: what makes its files, and what its lens lacks.

    `writer` is as in `Format`. `lacks` is 'shear', or 'affinity and shear', or empty. `paths` says
    whether names of photographs may be the same in several folders, `fisheye` whether it holds
    equidistant fisheye lenses. Without `cameras`, it holds targets alone.
    """

    writer: str
    lacks: Literal['', 'shear', 'affinity and shear'] = ''
    paths: bool = False
    fisheye: bool = False
    cameras: bool = True


_BOTH: Literal['affinity and shear'] = 'affinity and shear'
_POINTS = 'network.export.point_files'

NETWORK_FORMATS: Mapping[str, NetworkFormat] = {
    'colmap': NetworkFormat(
        'network.export.colmap:colmap_model_files', 'shear', paths=True, fisheye=True
    ),
    'metashape': NetworkFormat('network.export.xml_files:metashape_network_files', fisheye=True),
    'mmvii': NetworkFormat('network.export.xml_files:mmvii_network_files'),
    'blocksexchange': NetworkFormat(
        'network.export.blocks_exchange:blocks_exchange_files', 'shear'
    ),
    'realitycapture': NetworkFormat('network.export.reality_capture:reality_capture_files', _BOTH),
    'opf': NetworkFormat('network.export.opf_network:opf_network_files', _BOTH, paths=True),
    'alicevision': NetworkFormat(
        'network.export.sfm_data:alicevision_files', 'shear', paths=True, fisheye=True
    ),
    'openmvg': NetworkFormat(
        'network.export.sfm_data:openmvg_files', _BOTH, paths=True, fisheye=True
    ),
    'bundler': NetworkFormat('network.export.bundler:bundler_files'),
    'ply': NetworkFormat(f'{_POINTS}:ply_files', cameras=False),
    'dxf': NetworkFormat(f'{_POINTS}:dxf_files', cameras=False),
    'vstars': NetworkFormat(f'{_POINTS}:vstars_files', cameras=False),
    'jag3d': NetworkFormat(f'{_POINTS}:jag3d_files', cameras=False),
}
"""The formats of adjusted networks."""

_NOTABLE = 0.02  # px, by which image points differ for a lens that lacks something


def parsed_export(text: str, formats: Collection[str]) -> tuple[str, Path]:
    """Return format and folder of a text such as 'odm=out/odm', or raise a ValueError."""
    name, _, folder = text.partition('=')
    if name not in formats or not folder:
        raise ValueError(
            f'export is {text!r}, accepted is FORMAT=DIR with a format of {", ".join(formats)}'
        )
    return name, Path(folder)


@dataclass(frozen=True, slots=True)
class Export:
    """A format and the folder that its files are written to."""

    format: str
    folder: Path

    @classmethod
    def parsed(cls, text: str) -> Export:
        """Return the export that a text such as 'odm=out/odm' is, or raise a ValueError."""
        return cls(*parsed_export(text, FORMATS))

    def check_names(self, paths: Iterable[str]) -> None:
        """Raise a ValueError if the format could not tell two images apart."""
        if FORMATS[self.format].paths:
            return
        seen: dict[str, str] = {}
        for path in paths:
            file = PurePath(path).name
            if file in seen:
                raise ValueError(
                    f'{self.format} knows images by their names, {path!r} and {seen[file]!r} have '
                    'the same, accepted are different names'
                )
            seen[file] = path

    def write(
        self, images: Sequence[MeasuredImage], control: Control | None = None
    ) -> tuple[Path, ...]:
        """Write the files of the export, all or none, and return their paths.

        A ValueError says what the format cannot hold, or which file cannot be written.
        """
        from ahf_ros.network.export.survey import make_survey

        self.check_names(image.path for image in images)
        kind = FORMATS[self.format]
        survey = make_survey(images, control if kind.control else None, kind.origin)
        return write_files(self.folder, resolve_name(f'ahf_ros.{kind.writer}')(survey).items())


def write_network_export(format_name: str, folder: Path, solution: Solution) -> tuple[Path, ...]:
    """Write a network for other software, all files or none, and return the paths.

    A ValueError says what the format cannot hold, or which file cannot be written.
    """
    kind = NETWORK_FORMATS[format_name]
    if kind.cameras:
        solution.check_forward()
    if kind.cameras and not kind.fisheye:
        _check_lenses(format_name, solution)
    names = [PurePath(it).name for it in solution.network.photographs]
    if kind.cameras and not kind.paths and len(set(names)) < len(names):
        raise ValueError(
            f'{format_name} knows images by their names, accepted are different names in all '
            'folders'
        )
    return write_files(folder, resolve_name(f'ahf_ros.{kind.writer}')(solution).items())


def _check_lenses(format_name: str, solution: Solution) -> None:
    """Raise a ValueError if a lens is a fisheye one, which the format does not hold."""
    able = [name for name, it in NETWORK_FORMATS.items() if it.fisheye]
    if names := [it.name for it in solution.network.cameras if it.equidistant]:
        raise ValueError(
            f'camera {names[0]} has an equidistant fisheye lens, accepted by {format_name} are '
            f"lenses of Brown's model; {', '.join(able)}, camera_opencv.yaml and camera_ros.yaml "
            'have fisheye ones'
        )


def network_remark(format_name: str, solution: Solution) -> str:
    """Return what the lens of a format lacks and by how much it matters; empty for nothing."""
    from ahf_ros.network.export.adjusted import lens_loss

    lacks = NETWORK_FORMATS[format_name].lacks
    loss = lens_loss(solution, square=lacks == _BOTH) if lacks else 0.0
    if loss < _NOTABLE:
        return ''
    return f'{format_name} has no {lacks}: its image points differ by up to {loss:.2f} px'
