"""Readers of exported surveys that share nothing with what writes them.

Each returns the places of the targets, px, (0, 0) being the centre of the first pixel, by the name
of the image and the label; each states where its format has (0, 0).
"""

import csv
import json
import sqlite3
import struct
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path
from urllib.parse import unquote, urlparse

Places = dict[tuple[str, str], tuple[float, float]]

CORNER = 0.5
"""Coordinate of the centre of the first pixel where (0, 0) is its corner."""


def read_metashape(folder: Path) -> Places:
    root = ElementTree.parse(folder / 'markers.xml').getroot()
    assert (root.tag, root.get('version')) == ('document', '1.2.0')
    cameras = {it.attrib['id']: it.attrib['label'] for it in root.iter('camera')}
    labels = {
        it.attrib['id']: it.attrib['label'] for it in root.findall('.//chunk/markers/marker')
    }
    places = {}
    for marker in root.findall('./chunk/frames/frame/markers/marker'):
        for found in marker.findall('location'):
            assert found.attrib['pinned'] == 'true'
            key = cameras[found.attrib['camera_id']], labels[marker.attrib['marker_id']]
            places[key] = float(found.attrib['x']) - CORNER, float(found.attrib['y']) - CORNER
    return places


def read_mmvii(folder: Path) -> Places:
    places = {}
    for file in folder.glob('MMVII-PhgrProj/ObjMesInstr/ahf/MesIm-*.xml'):
        root = ElementTree.parse(file).getroot()
        assert root.findtext('Type') == '"MMVII_Serialization"'
        image = root.findtext('Data/SetMesIm/NameIm', '').strip('"')
        assert file.name == f'MesIm-{image}.xml'
        for item in root.findall('Data/SetMesIm/Measures/el'):
            xx, _, yy = map(float, item.findtext('Sigma2', '').split())
            assert xx > 0 and yy > 0
            x, y = map(float, item.findtext('Pt', '').split())
            places[image, item.findtext('Name', '').strip('"')] = x, y
    return places


def read_colmap(folder: Path) -> Places:
    with (folder / 'keypoints.csv').open(newline='') as file:
        rows = list(csv.DictReader(file))
    labels = {(row['image'], int(row['keypoint'])): row['label'] for row in rows}
    places = {}
    connection = sqlite3.connect(folder / 'targets.db')
    query = 'SELECT name, rows, cols, data FROM images JOIN keypoints USING (image_id)'
    for name, count, columns, data in connection.execute(query):
        assert (columns, len(data)) == (2, 8 * count)
        for number, (x, y) in enumerate(struct.iter_unpack('<ff', data)):
            places[name, labels[name, number]] = x - CORNER, y - CORNER
    connection.close()
    assert len(places) == len(rows)
    return places


def read_opf(folder: Path) -> Places:
    project = json.loads((folder / 'project.opf').read_text())
    files = {item['type']: item['resources'][0]['uri'] for item in project['items']}
    cameras = json.loads((folder / files['camera_list']).read_text())['cameras']
    names = {it['id']: Path(unquote(urlparse(it['uri']).path)).name for it in cameras}
    points = json.loads((folder / files['input_control_points']).read_text())
    places = {}
    for point in points['gcps'] + points['mtps']:
        for mark in point['marks']:
            x, y = mark['position_px']
            places[names[mark['camera_id']], point['id']] = x - CORNER, y - CORNER
    return places


def read_odm(folder: Path) -> Places:
    """Read as OpenSfM does: five numbers, the name of the image, and what it ignores."""
    places = {}
    for line in (folder / 'gcp_list.txt').read_text().splitlines()[1:]:
        words = line.split(None, 5)
        _, _, _, x, y = map(float, words[:5])
        name, label = words[5].split()
        places[name, label] = x, y
    return places


def read_realitycapture(folder: Path) -> Places:
    places = {}
    with (folder / 'control_points.csv').open(newline='') as file:
        for name, label, x, y in csv.reader(line for line in file if not line.startswith('#')):
            places[name, label] = float(x) - CORNER, float(y) - CORNER
    return places


def read_csv(folder: Path) -> Places:
    with (folder / 'targets.csv').open(newline='') as file:
        return {
            (Path(row['image']).name, row['label']): (float(row['x']), float(row['y']))
            for row in csv.DictReader(file)
        }


READERS: dict[str, Callable[[Path], Places]] = {
    'metashape': read_metashape,
    'mmvii': read_mmvii,
    'colmap': read_colmap,
    'opf': read_opf,
    'odm': read_odm,
    'realitycapture': read_realitycapture,
    'csv': read_csv,
}
