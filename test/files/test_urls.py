"""Images behind URLs."""

import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('fsspec', reason='fsspec is not installed')

import fsspec

from ahf_ros.batch.identification import file_fingerprint
from ahf_ros.cli.identify import image_paths
from ahf_ros.files.image_files import read_image, write_image

IMAGE = np.arange(400, dtype=np.uint8).reshape(20, 20)


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        """Print nothing."""


def test_images_in_a_storage_are_named_read_and_told_apart(tmp_path: Path) -> None:
    write_image(tmp_path / 'image.png', IMAGE)
    content = (tmp_path / 'image.png').read_bytes()
    for name in ('b.png', 'a.PNG', 'notes.txt'):
        fsspec.filesystem('memory').pipe(f'/survey/{name}', content)
    names = ['memory://survey/a.PNG', 'memory://survey/b.png']
    for argument in ('memory://survey', 'memory://survey/*.[pP]*'):
        paths, problems, _ = image_paths([argument])
        assert ([path.replace(':///', '://') for path in paths], problems) == (names, [])
    np.testing.assert_array_equal(read_image(names[1]), IMAGE)
    before = file_fingerprint(names[1])
    assert before.startswith(f'{len(content)} ')
    fsspec.filesystem('memory').pipe('/survey/b.png', content)
    assert file_fingerprint(names[1]) != before
    assert file_fingerprint('memory://survey/missing.png') == ''


def test_images_of_a_web_server_are_read(tmp_path: Path) -> None:
    pytest.importorskip('aiohttp', reason='aiohttp is not installed')
    write_image(tmp_path / 'image.png', IMAGE)
    with ThreadingHTTPServer(('127.0.0.1', 0), partial(Quiet, directory=tmp_path)) as server:
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        address = f'http://127.0.0.1:{server.server_address[1]}'
        np.testing.assert_array_equal(read_image(f'{address}/image.png'), IMAGE)
        with pytest.raises(ValueError, match=r'missing\.png cannot be read: FileNotFoundError'):
            read_image(f'{address}/missing.png')
        server.shutdown()


@pytest.mark.parametrize(
    ('url', 'reason'),
    [
        ('memory://survey/none.png', 'FileNotFoundError'),
        ('nothing://a.png', 'Protocol not known: nothing'),
    ],
)
def test_what_cannot_be_read_is_named(url: str, reason: str) -> None:
    with pytest.raises(ValueError, match=f'{url} cannot be read: .*{reason}'):
        read_image(url)
