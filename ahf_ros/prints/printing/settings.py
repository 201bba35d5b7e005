"""What is printed, and on what."""

from dataclasses import dataclass, field

from ahf_ros.base.settings.parameter import check_parameters, numbers_in, parameter
from ahf_ros.prints import SQUARE_NAMES
from ahf_ros.prints.families import ONE, FamilyPrint, check_numbers, print_in
from ahf_ros.prints.printing.paper import LABEL_SHEETS, Page, length_in, page_in
from ahf_ros.prints.prints import Proportions
from ahf_ros.prints.selection import select_ids
from ahf_ros.prints.square import HALF_SIDE

_NO_LABELS = 'none'


@dataclass(frozen=True, slots=True)
class SheetSettings:
    """Targets to print, and the pages that they are printed on."""

    family: str = parameter('metashape12', 'Family of the targets.', form=ONE)
    family_file: str = parameter(
        '', 'Data files that describe families, as for the detector.', files=True
    )
    ids: str = parameter('', 'IDs and ranges of IDs, such as 1-54, 60; empty: all of the family.')
    best: int = parameter(
        0,
        'Number of IDs to select from these, so that they are as hard to confuse as possible; 0: '
        'all of them.',
        minimum=0,
    )
    polarity: str = parameter(
        'auto',
        'Dark targets on white, or bright ones on black; auto: as the family, dark where it may '
        'be either.',
        choices=('auto', 'dark', 'bright'),
    )
    dot_radius: str = parameter(
        '',
        'Radius of the dot, with a unit; it scales the whole target. Empty: 4 mm.',
        form='a length such as 4mm, 0.4cm or 0.25in',
    )
    side: str = parameter(
        '',
        'Side of a square marker, with a unit, instead of dot_radius.',
        form='a length such as 40mm',
    )
    pinhole: float = parameter(
        -1.0,
        'Radius of the hole in the dot, in dot radii; 0: none, -1: that of the family. gsi and '
        'square markers have none.',
        minimum=-1.0,
        maximum=0.5,
    )
    page: str = parameter(
        '',
        'Page: A0 to A6, letter, legal, tabloid, or a size such as 210x297mm. Empty: A4, or that '
        'of the labels.',
    )
    landscape: bool = parameter(False, 'Whether the page is turned.')
    labels: str = parameter(
        _NO_LABELS, 'Sheet of labels, one target on each.', choices=(_NO_LABELS, *LABEL_SHEETS)
    )
    per_page: int = parameter(
        0, 'Maximum number of targets on a page; 0: as many as there is room for.', minimum=0
    )
    print: FamilyPrint = field(init=False, repr=False, hash=False)

    def __post_init__(self) -> None:
        """Check each parameter, and that they fit each other."""
        check_parameters(self)
        object.__setattr__(self, 'print', print_in(self.family, self.family_file))
        object.__setattr__(self, 'family', self.print.name)
        check_numbers('ids', numbers_in('ids', self.ids), [self.print])
        square = self.family in SQUARE_NAMES
        if square and self.colour != 'dark':
            raise ValueError(
                f'polarity is {self.polarity!r} and family is {self.family!r}; accepted with '
                'square markers is dark, which is what detectors read'
            )
        if self.side and (self.dot_radius or not square):
            raise ValueError(
                f'side is {self.side!r}, accepted is a length for a family of square markers and '
                'without dot_radius'
            )
        if self.on_labels and (self.page or self.landscape):
            raise ValueError(
                f'labels is {self.labels!r}, accepted with page and landscape is {_NO_LABELS}: '
                'labels have their own page'
            )
        _ = self.radius, self.paper

    @property
    def numbers(self) -> list[int]:
        """IDs of the targets, ascending; a ValueError if so many as `best` are not found."""
        given = numbers_in('ids', self.ids)
        every = sorted(given) if given else self.print.design.all_ids
        if not self.best:
            return every
        if self.best > len(every):
            raise ValueError(
                f'best is {self.best}, accepted is an integer from 1 to {len(every)}, the number '
                'of IDs to select from'
            )
        return select_ids(self.print.design, every, self.best)

    @property
    def radius(self) -> float:
        """Radius of the dot, mm."""
        if self.side:
            return length_in('side', self.side) / (2 * HALF_SIDE)
        return length_in('dot_radius', self.dot_radius or '4mm')

    @property
    def size(self) -> str:
        """The size of a target as text."""
        return f'{self.size_name} {self.size_factor * self.radius:.4g} mm'

    @property
    def size_name(self) -> str:
        """What is given as the size of a target: the radius of the dot, or the side."""
        return 'side' if self.family in SQUARE_NAMES else 'r'

    @property
    def size_factor(self) -> float:
        """The size of a target in radii of the dot."""
        return 2 * HALF_SIDE if self.family in SQUARE_NAMES else 1.0

    @property
    def proportions(self) -> Proportions:
        """What all targets have in common, in radii of the dot."""
        return self.print.design.proportions.chosen(self.polarity, self.pinhole)

    @property
    def colour(self) -> str:
        """Colour of the ink, 'dark' or 'bright'."""
        return self.proportions.polarity

    @property
    def hole(self) -> float:
        """Radius of the hole in the dot, in radii of the dot, 0 for none."""
        return self.proportions.pinhole

    @property
    def on_labels(self) -> bool:
        """Whether targets are printed on labels."""
        return self.labels != _NO_LABELS

    @property
    def paper(self) -> Page:
        """The page."""
        page = page_in('letter' if self.on_labels else self.page or 'A4')
        if self.landscape:
            return Page(f'{page.name} landscape', page.height, page.width)
        return page
