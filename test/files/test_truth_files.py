"""Truth in CSV files; every file and line that cannot be used is named."""

from pathlib import Path

import pytest

from ahf_ros.base.target import TrueTarget
from ahf_ros.files.truth_files import read_truth, write_truth


def test_truth_that_is_written_is_read(tmp_path: Path) -> None:
    truth = {
        'a.png': (TrueTarget(3, 1.25, 2.5), TrueTarget(7, 100.1234, 3.0, confirmed=False)),
        'b.png': (TrueTarget(1, 0.0, 0.0),),
    }
    write_truth(tmp_path / 'truth.csv', truth)
    assert read_truth(tmp_path / 'truth.csv') == truth


def test_truth_in_another_order_with_folders_and_no_confirmed(tmp_path: Path) -> None:
    (tmp_path / 'truth.csv').write_text('\ufeffid,y,x,image,note\n5,2,1,in/a.png,?\n', 'utf-8')
    assert read_truth(tmp_path / 'truth.csv') == {'a.png': (TrueTarget(5, 1.0, 2.0),)}


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('image,id,x\n', 'has no column y'),
        ('', 'is empty, accepted is a table with image, id, x, y'),
        ('image,id,x,y\na.png,1,2,far\n', "line 2: y is 'far', accepted is a finite number"),
        ('image,id,x,y\na.png,1,nan,2\n', "line 2: x is 'nan', accepted is a finite number from"),
        ('image,id,x,y\na.png,one,1,2\n', "line 2: id is 'one', accepted is an integer"),
        ('image,id,x,y\na.png,1\n', 'line 2 has 2 cells, accepted are as many as columns'),
        ('image,id,x,y\n,1,2,3\n', "line 2: image is '', accepted is a printable text"),
        ('image,id,x,y\ni/a,1,2,3\nj/a,1,2,3\n', 'line 3: a is in two folders'),
        (f'image,id,x,y\na,{"9" * 400},2,3\n', "line 2: id is '999.*, .* an integer from -1 to"),
        (f'image,id,x,y\na,{"9" * 5000},2,3\n', "line 2: id is '999.*, accepted is an integer"),
        ('image,id,x,y\na,1,1e308,3\n', "line 2: x is '1e308', accepted is a finite number"),
        (f'image,id,x,y\na,1,{"1" * 200_000},3\n', 'line 2: field larger than field limit'),
        (f'image,id,x,y,{"x" * 200_000}\n', 'line 1: field larger than field limit'),
    ],
)
def test_truth_that_cannot_be_used_is_named(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / 'truth.csv').write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        read_truth(tmp_path / 'truth.csv')
    assert str(tmp_path / 'truth.csv') in str(caught.value)
    assert len(str(caught.value)) < 1000


def test_truth_that_is_no_text_is_named(tmp_path: Path) -> None:
    (tmp_path / 'image.png').write_bytes(b'\x89PNG\r\n\xff')
    with pytest.raises(ValueError, match=r'image.png is not a text'):
        read_truth(tmp_path / 'image.png')
