"""A real browser without a window."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

_PROGRAMS = ('chromium', 'chromium-browser', 'google-chrome')
_OPTIONS = (
    '--headless=new',
    '--no-sandbox',  # of root, as in containers
    '--disable-gpu',
    '--disable-dev-shm-usage',
    '--disable-background-networking',
    '--disable-component-update',
    '--hide-scrollbars',
    '--window-size=1600,1000',
)


@contextmanager
def opened(loading: str = 'normal') -> Iterator[Any]:
    """Yield a Chromium that selenium drives, or skip where it is not installed or does not start.

    `loading` is the strategy of selenium: 'none' does not wait until a page is complete.
    """
    webdriver = pytest.importorskip('selenium.webdriver', reason='selenium is not installed')
    exceptions = pytest.importorskip('selenium.common.exceptions')
    program = next((path for path in map(shutil.which, _PROGRAMS) if path), None)
    driver = shutil.which('chromedriver')
    if not (program and driver):
        pytest.skip('Chromium is not installed: apt install chromium chromium-driver')
    options = webdriver.ChromeOptions()
    options.binary_location = program
    options.page_load_strategy = loading
    options.set_capability('goog:loggingPrefs', {'browser': 'ALL'})
    for option in _OPTIONS:
        options.add_argument(option)
    service = webdriver.ChromeService(executable_path=driver)
    try:
        browser = webdriver.Chrome(options=options, service=service)
    except exceptions.WebDriverException as error:  # such as a snap in a container
        pytest.skip(f'Chromium does not start: {error.msg}')
    try:
        yield browser
    finally:
        browser.quit()
