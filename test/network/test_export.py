"""Exports, read back by other software where there is some, and by readers of their own."""

import csv
import math
import runpy
import sqlite3
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ahf_ros.base.target import UNDECODED, Target
from ahf_ros.network.export.formats import FORMATS, Export
from ahf_ros.network.export.survey import (
    Control,
    MeasuredImage,
    make_survey,
    notes_on,
    read_measured_images,
)
from support.disk import room_for
from support.exported import READERS

POINTS = {
    '007': np.array([0.1, -2.5, 3e5]),
    '9': np.array([1 / 3, 0.0, 5.0]),
    'nugget': np.ones(3),
}
CONTROL = Control(POINTS, 'EPSG:25832', 0.02)


def target(number: int, x: float, y: float, family: str = 'aicon14') -> Target:
    covariance = (4e-4, 1e-5, 1e-5, 9e-4)
    return Target(number, 19, x, y, 8.0, 7.5, 0.25, 0.99, covariance, family)


def image(path: str, *targets: Target) -> list[MeasuredImage]:
    return [MeasuredImage(path, 60, 40, targets)]


IMAGES = (
    MeasuredImage(
        'in/a-b&ü.jpg',
        8000,
        6000,
        (
            target(UNDECODED, 5.0, 5.0, ''),
            target(9, 7999.1234567, 0.0),
            target(7, 10.0004999, 1234.56789),
        ),
    ),
    MeasuredImage('in/deep/b.jpg', 8000, 6000, (target(7, -0.5, 20.0), target(11, 30.0, 40.25))),
    MeasuredImage('in/deep/c.jpg', 640, 480, ()),
)
EXPECTED = {
    ('a-b&ü.jpg', '7'): (10.0004999, 1234.56789),
    ('a-b&ü.jpg', '9'): (7999.1234567, 0.0),
    ('b.jpg', '7'): (-0.5, 20.0),
    ('b.jpg', '11'): (30.0, 40.25),
}


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with all exports, each of which has files of its own."""
    folder = tmp_path_factory.mktemp('exports')
    files = [file for name in FORMATS for file in Export(name, folder).write(IMAGES, CONTROL)]
    assert len(set(files)) == len(files)
    assert {it for it in folder.rglob('*') if it.is_file()} == set(files)
    return folder


@pytest.mark.parametrize('name', FORMATS)
def test_places_are_those_of_the_images(name: str, folder: Path) -> None:
    found = {(Path(image).name, label): it for (image, label), it in READERS[name](folder).items()}
    expected = {key: it for key, it in EXPECTED.items() if name != 'odm' or key[1] != '11'}
    assert found.keys() == expected.keys()
    for key, place in expected.items():
        assert math.dist(found[key], place) < 0.001


@pytest.mark.parametrize('name', FORMATS)
def test_the_same_survey_gives_the_same_files(name: str, folder: Path, tmp_path: Path) -> None:
    for file in Export(name, tmp_path).write(IMAGES, CONTROL):
        assert file.read_bytes() == (folder / file.relative_to(tmp_path)).read_bytes()


def test_control_points_go_along(folder: Path) -> None:
    seven = tuple(POINTS['007'])
    root = ElementTree.parse(folder / 'markers.xml').getroot()
    marker = root.find("chunk/markers/marker[@label='7']/reference")
    assert tuple(float(marker.attrib[axis]) for axis in 'xyz') == seven
    assert root.find("chunk/markers/marker[@label='11']/reference") is None
    file = folder / 'MMVII-PhgrProj/ObjMesInstr/ahf/MesGCP-ahf.xml'
    items = ElementTree.parse(file).getroot().findall('Data/SetGCP/Measures/el')
    assert [item.findtext('Name') for item in items] == ['"7"', '"9"']
    assert tuple(map(float, items[0].findtext('Pt').split())) == seven
    lines = (folder / 'gcp_list.txt').read_text().splitlines()
    assert (lines[0], len(lines)) == ('EPSG:25832', 4)
    assert tuple(map(float, lines[1].split()[:3])) == seven
    lines = (folder / 'ground_control.csv').read_text().splitlines()
    assert lines[1].split(',') == ['7', '0.1', '-2.5', '300000.0']
    with (folder / 'targets.csv').open(newline='') as table:
        rows = {(row['image'], row['label']): row for row in csv.DictReader(table)}
    assert float(rows['in/deep/b.jpg', '7']['control_z']) == 3e5
    assert rows['in/deep/b.jpg', '11']['control_z'] == ''
    assert float(rows['in/deep/b.jpg', '7']['variance_y']) == 9e-4


def test_what_is_no_control_point_is_said() -> None:
    notes = notes_on(CONTROL, make_survey(IMAGES, CONTROL))
    assert notes == [
        'control points that no image shows: nugget',
        'targets that are no control points: 11',
    ]


def test_labels_name_the_family_where_there_are_several() -> None:
    mixed = image('a.jpg', target(7, 1, 2), target(7, 3, 4, 'metashape12'))
    assert make_survey(mixed).labels == ('aicon14_7', 'metashape12_7')
    with pytest.raises(ValueError, match="'7' may be aicon14_7 or metashape12_7, accepted is"):
        make_survey(mixed, Control({'7': np.zeros(3)}))
    found = make_survey(mixed, Control({'metashape12_7': np.zeros(3)}))
    assert list(found.control) == ['metashape12_7']


@pytest.mark.parametrize('name', FORMATS)
def test_images_of_the_same_name(name: str, tmp_path: Path) -> None:
    alike = [*IMAGES[1:], *image('other/b.jpg')]
    if FORMATS[name].paths:
        Export(name, tmp_path).write(alike)
        with pytest.raises(ValueError, match=r"'in/\./deep/b\.jpg' is there twice, accepted is"):
            Export(name, tmp_path).write([*IMAGES, *image('in/./deep/b.jpg')])
    else:
        message = f"{name} knows images by their names, 'other/b.jpg' and 'in/deep/b.jpg' have"
        with pytest.raises(ValueError, match=message):
            Export(name, tmp_path).write(alike, CONTROL)
        assert list(tmp_path.iterdir()) == []


TWICE = Control({'7': np.ones(3), '07': np.ones(3)})
SEVEN = target(7, 1, 1)


@pytest.mark.parametrize(
    ('name', 'images', 'control', 'message'),
    [
        ('odm', IMAGES, Control(POINTS, 'UTM 32'), "is 'UTM 32', accepted is EPSG:CODE, WGS84"),
        ('odm', IMAGES, None, 'odm has only control points'),
        ('odm', IMAGES, Control(POINTS), "odm has no local coordinates, control_crs is '', accep"),
        ('odm', image('a b.jpg', SEVEN), CONTROL, "odm splits at blanks, .* without: 'a b.jpg'"),
        ('opf', IMAGES, Control(POINTS), 'opf has a standard deviation, accepted is a control si'),
        ('csv', IMAGES, Control({'5': np.zeros(3)}), 'the list has 5, the images show 7, 9, 11'),
        ('csv', IMAGES, TWICE, 'control point 7 is there twice'),
        ('csv', IMAGES[2:], None, 'no image shows an identified target, accepted is at least one'),
        ('csv', image('a', SEVEN, target(7, 2, 2)), None, 'a shows target 7 twice'),
        ('csv', image('\udc80'), None, 'accepted is a name that prints'),
        ('mmvii', image('a".jpg', SEVEN), None, 'accepted is a name without "'),
        ('mmvii', image('a', SEVEN, target(7, 2, 2, 'my"own')), None, 'is a label without "'),
    ],
)
def test_what_a_format_cannot_hold_is_named(
    name: str, images: Any, control: Any, message: str, tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match=message):
        Export(name, tmp_path).write(images, control)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize('text', ['csv', 'csv=', '=out', 'photomodeler=out'])
def test_an_unknown_format_is_named(text: str) -> None:
    message = f"export is '{text}', accepted is FORMAT=DIR with a format of metashape, mmvii, colm"
    with pytest.raises(ValueError, match=message):
        Export.parsed(text)


@pytest.mark.parametrize('name', FORMATS)
def test_a_full_disk_leaves_whole_files(name: str, tmp_path: Path) -> None:
    export = Export(name, tmp_path)
    before = {file: file.read_bytes() for file in export.write(IMAGES, CONTROL)}
    with room_for(20), pytest.raises(ValueError, match='cannot be written'):
        export.write(IMAGES[1:], CONTROL)
    assert {it: it.read_bytes() for it in tmp_path.rglob('*') if it.is_file()} == before


def test_a_database_that_cannot_be_made_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path / 'missing'))
    with pytest.raises(ValueError, match=r'targets\.db cannot be written: No such file'):
        Export('colmap', tmp_path).write(IMAGES)


def test_results_are_read_with_the_size_of_each_image(tmp_path: Path) -> None:
    file = tmp_path / 'results.jsonl'
    line = '{"image": "in/a.jpg", "width": 6, "height": 4, "targets": []'
    file.write_text(f'{line}, "images": ["in/a.jpg", "in/b.jpg"]}}\n')
    assert read_measured_images(file) == (MeasuredImage('in/a.jpg', 6, 4, ()),)
    file.write_text('{"image": "in/a.jpg", "width": 6, "targets": []}\n')
    with pytest.raises(ValueError, match='line 1: height is None, accepted is an integer from 1'):
        read_measured_images(file)


class Marker:
    """A marker as Metashape's console has it."""

    Projection = staticmethod(lambda place, pinned: (place, pinned))

    def __init__(self, label: str = '') -> None:
        self.label = label
        self.projections: dict[object, object] = {}
        self.reference = SimpleNamespace(location=None, enabled=False)


def console(cameras: list[SimpleNamespace], markers: list[Marker]) -> ModuleType:
    """Return a stand-in for the module of Metashape's console."""

    def add() -> Marker:
        markers.append(Marker())
        return markers[-1]

    chunk = SimpleNamespace(cameras=cameras, markers=markers, addMarker=add)
    module = ModuleType('Metashape')
    module.app = SimpleNamespace(document=SimpleNamespace(chunk=chunk))
    module.Vector, module.Marker = tuple, Marker
    return module


class Camera(SimpleNamespace):
    __hash__ = object.__hash__


def test_the_script_sets_the_markers(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    camera = Camera(label='b', photo=SimpleNamespace(path='C:\\photos\\b.jpg'))
    there = Marker('7')
    module = console([camera], [there])
    monkeypatch.setitem(sys.modules, 'Metashape', module)
    runpy.run_path(str(folder / 'metashape_console.py'), run_name='__main__')
    assert capsys.readouterr().out == 'a-b&ü.jpg is not in the active chunk\n'
    assert there.projections == {camera: ((0.0, 20.5), True)}
    assert (there.reference.location, there.reference.enabled) == (tuple(POINTS['007']), True)
    chunk = module.app.document.chunk
    assert [marker.label for marker in chunk.markers] == ['7', '9', '11']
    assert chunk.markers[2].projections == {camera: ((30.5, 40.75), True)}
    assert chunk.markers[2].reference.location is None


def test_colmap_reads_the_database(folder: Path) -> None:
    pycolmap = pytest.importorskip('pycolmap', reason='pycolmap is a large download')
    with pycolmap.Database.open(folder / 'targets.db') as database:
        images = {image.name: image for image in database.read_all_images()}
        assert sorted(images) == ['a-b&ü.jpg', 'deep/b.jpg', 'deep/c.jpg']
        first, second = images['a-b&ü.jpg'], images['deep/b.jpg']
        assert first.camera_id == second.camera_id != images['deep/c.jpg'].camera_id
        camera = database.read_camera(first.camera_id)
        assert (camera.width, camera.height, camera.focal_length) == (8000, 6000, 9600)
        places = database.read_keypoints(first.image_id)
        assert np.abs(places - [(10.5005, 1235.06789), (7999.62346, 0.5)]).max() < 0.001
        assert database.read_matches(first.image_id, second.image_id).tolist() == [[0, 0]]
        geometry = database.read_two_view_geometry(first.image_id, second.image_id)
        assert geometry.inlier_matches.tolist() == [[0, 0]]


def test_pairs_without_a_common_point_have_no_matches(folder: Path) -> None:
    connection = sqlite3.connect(folder / 'targets.db')
    assert connection.execute(
        'SELECT pair_id, rows, config FROM two_view_geometries'
    ).fetchall() == [(2147483647 + 2, 1, 3)]
    connection.close()


def test_pyopf_reads_the_project(folder: Path) -> None:
    pyopf = pytest.importorskip('pyopf.io', reason='pyopf is not installed')
    resolve = pytest.importorskip('pyopf.resolve')
    project = resolve.resolve(pyopf.load(str(folder / 'project.opf')))
    (points,) = project.input_control_points_objs
    assert [(point.id, list(point.geolocation.sigmas)) for point in points.gcps] == [
        ('7', [0.02] * 3),
        ('9', [0.02] * 3),
    ]
    assert points.gcps[0].geolocation.crs.definition == 'EPSG:25832'
    (mark,) = points.mtps[0].marks
    assert mark.position_px.tolist() == [30.5, 40.75]
    assert mark.accuracy == pytest.approx(math.sqrt(6.5e-4))
    (cameras,) = project.camera_list_objs
    uris = {camera.id: camera.uri for camera in cameras.cameras}
    assert uris[mark.camera_id].endswith('/in/deep/b.jpg')
