"""Tables of other programs: names of columns, separators, decimal marks, and labels."""

from pathlib import Path

import numpy as np
import pytest

from ahf_ros.files.tables import POINT, read_points, read_table
from ahf_ros.network.files.control_files import read_control

UTM = {'1': [500329.1159, 5452818.8311, 1000.3608], '5': [-0.5, 2.0, 0.03]}

READ = {
    'commas': 'id,x,y,z\n1,500329.1159,5452818.8311,1000.3608\n5,-.5,2,3e-2\n',
    'in another order': 'z,id,y,x\n1000.3608,1,5452818.8311,500329.1159\n3e-2,5,2.,-0.5\n',
    'semicolons': 'id;x;y;z\n1;500329,1159;5452818,8311;1000,3608\n5;-0,5;2;3e-2\n',
    'tabs': 'id\tx\ty\tz\n1\t500329,1159\t5452818,8311\t1000,3608\n5\t-,5\t2,\t0,03\n',
    'points, tabs': 'id\tx\ty\tz\n1\t500329.1159\t5452818.8311\t1000.3608\n5\t-.5\t2\t0.03\n',
    'no header': '1,500329.1159,5452818.8311,1000.3608\n5,-0.5,2,0.03\n',
    'no header, more columns': '1,500329.1159,5452818.8311,1000.3608,0,0,0\n5,-0.5,2,0.03,1,1,1\n',
    'Metashape': '#CoordinateSystem: UTM\n#Label,X/East,Y/North,Z/Altitude,Accuracy_X/East_(m)\n'
    'target 1,500329.1159,5452818.8311,1000.3608,0.1\ntarget 5,-0.5,2,0.03,\n',
    'units': 'Name;Northing (m);Easting (m);Height (m)\n1;5452818,8311;500329,1159;1000,3608\n'
    '5;2;-0,5;0,03;\n',
    'name beside id': 'name,id,x,y,z\nA,1,500329.1159,5452818.8311,1000.3608\nB,5,-0.5,2,0.03\n',
}

REFUSED = {
    'decimal commas between commas': (
        'id,x,y,z\n1,500329,1159,5452818,8311,1000,3608\n',
        'line 2 has 7 cells.*decimal commas need semicolons or tabs',
    ),
    'the same without a header': (
        '1,500329,1159,5452818,8311,1000,3608\n',
        'no header and no decimal points.*decimal commas need semicolons or tabs',
    ),
    'both marks': ('id;x;y;z\n1;1,5;2.5;3\n', "line 2: y is '2.5', .*another decimal mark"),
    'both marks in one number': ('id;x;y;z\n1;1.234,5;2;3\n', "line 2: x is '1.234,5', accepted"),
    'quoted decimal commas': ('id,x,y,z\n1,"1,5",2,3\n', "line 2: x is '1,5', accepted"),
    'another header': ('id,lon,lat,z\n1,2,3,4\n', "no column x, y, its columns are 'id, lon"),
    'words for numbers': ('id,x,y,z\n1,2,1_0,4\n', "line 2: y is '1_0', accepted"),
    'a surplus cell': ('id;x;y;z\n1;2;3;4;5\n', 'line 2 has 5 cells, accepted are .* 4$'),
    'too large': ('id,x,y,z\n1,2,3,1e308\n', "line 2: z is '1e308', accepted is a finite"),
    'a label twice': (
        'id,x,y,z\n5,1,2,3\ntarget 5,1,2,3\n',
        "line 3: id is '5', which line 2 has",
    ),
}


@pytest.mark.parametrize('name', READ)
@pytest.mark.parametrize('encoding', ['utf-8', 'utf-8-sig', 'utf-16', 'utf-16-le'])
def test_points_of_other_programs_are_read(tmp_path: Path, name: str, encoding: str) -> None:
    path = tmp_path / 'points.csv'
    path.write_text(READ[name], encoding)
    found = read_points(path)
    assert found.keys() == UTM.keys()
    np.testing.assert_array_equal(list(found.values()), list(UTM.values()))
    control = {it.name: it.xyz.tolist() for it in read_control(path)}
    assert control == {label: point.tolist() for label, point in found.items()}


@pytest.mark.parametrize('name', REFUSED)
def test_what_is_ambiguous_is_refused(tmp_path: Path, name: str) -> None:
    text, message = REFUSED[name]
    path = tmp_path / 'points.csv'
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as error:
        read_points(path)
    assert str(path) in str(error.value)


def test_lines_are_counted_behind_comments_and_header(tmp_path: Path) -> None:
    path = tmp_path / 'points.csv'
    path.write_text('# of today\n\nid,x,y,z\n# more\n1,2,3,4\n')
    columns, rows = read_table(path, POINT)
    assert columns == POINT
    assert [row.where for row in rows] == [f'{path}, line 5']
