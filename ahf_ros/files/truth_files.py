"""Tables of the targets that images show, as CSV files."""

from pathlib import Path

from ahf_ros.base.opening import reader
from ahf_ros.base.target import UNDECODED, TrueTarget, Truth
from ahf_ros.base.target_check import MAXIMUM_ID, MAXIMUM_LENGTH_PX
from ahf_ros.base.writing import write_whole
from ahf_ros.files.files import checked_file_name, csv_table
from ahf_ros.files.tables import Row, read_table


@reader('a table of true targets in CSV')
def read_truth(path: str | Path) -> dict[str, tuple[TrueTarget, ...]]:
    """Return the targets that images show, from a CSV file.

    Its header names the columns image, id, x, y and, optionally, confirmed (1 or 0), in any order;
    other columns are ignored, and so are the folders of an image. A ValueError names a file or
    line that is not like that.
    """
    _, rows = read_table(path, ('image', 'id', 'x', 'y'), empty=True)
    truth: dict[str, list[TrueTarget]] = {}
    images: dict[str, str] = {}
    for row in rows:
        image = row.text('image')
        name = checked_file_name(image, f'{row.where}: image')
        if images.setdefault(name, image) != image:
            raise ValueError(
                f'{row.where}: {name} is in two folders, accepted is one image a name'
            )
        truth.setdefault(name, []).append(_target(row))
    return {name: tuple(targets) for name, targets in truth.items()}


def write_truth(path: str | Path, truth: Truth) -> None:
    """Write the targets that images show for `read_truth`, as a file that is whole or not there.

    Coordinates are written to 0.0001 px. A ValueError names a file that cannot be written.
    """
    rows = [['image', 'id', 'x', 'y', 'confirmed']]
    for name, targets in truth.items():
        for item in targets:
            place = [f'{item.x:.4f}', f'{item.y:.4f}']
            rows.append([name, str(item.id), *place, str(int(item.confirmed))])
    write_whole(path, csv_table(rows))


def _target(row: Row) -> TrueTarget:
    x, y = (row.number(axis, -MAXIMUM_LENGTH_PX, MAXIMUM_LENGTH_PX) for axis in 'xy')
    confirmed = 'confirmed' not in row.cells or row.integer('confirmed', 0, 1) == 1
    return TrueTarget(row.integer('id', UNDECODED, MAXIMUM_ID), x, y, confirmed)
