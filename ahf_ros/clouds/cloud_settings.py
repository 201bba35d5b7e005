"""How the points of a cloud belong to the pixels of its image.

The command line needs this before it computes anything, so nothing is imported here that does.
"""

from dataclasses import dataclass

from ahf_ros.base.settings.parameter import check_parameters, parameter

NEIGHBOURHOOD = 3.0
"""Radius of the neighbourhood of a centre, in radii of its dot: not beyond the code band."""

MAXIMUM_TOLERANCE = 10.0
"""Maximum difference between the stamps of an image and its cloud, s."""


@dataclass(frozen=True, slots=True)
class CloudGrid:
    """Which pixel of the image each point of a cloud belongs to.

    The point in row i and column j belongs to the pixel at x = `offset_x` + `step` j and
    y = `offset_y` + `step` i, px.

    Examples
    --------
    >>> CloudGrid(offset_x=32.0).fits((480, 608), (480, 640))
    True
    >>> CloudGrid().fits((480, 608), (480, 640))
    False
    """

    offset_x: float = 0.0
    offset_y: float = 0.0
    step: float = 1.0

    def fits(self, cloud: tuple[int, int], image: tuple[int, int]) -> bool:
        """Return whether a cloud lies within an image, by the numbers of their rows and columns.

        By default only a cloud of the size of the image does.
        """
        if self == FULL:
            return cloud == image
        axes = zip((self.offset_y, self.offset_x), cloud, image, strict=True)
        return all(first + self.step * (count - 1) <= size - 0.5 for first, count, size in axes)

    def check(self, cloud: tuple[int, int], image: tuple[int, int]) -> None:
        """Refuse a cloud that does not lie within its image, and say what to set."""
        if self.fits(cloud, image):
            return
        size, whole = f'{cloud[1]} x {cloud[0]}', f'{image[1]} x {image[0]}'
        if self == FULL:
            raise ValueError(
                f'cloud has {size} points, accepted is {whole}, the size of the image; for '
                'another one, set cloud_offset_x, cloud_offset_y and cloud_step'
            )
        raise ValueError(
            f'cloud has {size} points, accepted are those that an image of {whole} has room for '
            f'from x = {self.offset_x:g}, y = {self.offset_y:g} in steps of {self.step:g} px'
        )


FULL = CloudGrid()
"""Grid of a cloud that has one point per pixel."""


@dataclass(frozen=True, slots=True)
class CloudSettings:
    """Positions of targets in space, from the point cloud of the same shot."""

    cloud: bool = parameter(
        False,
        'Whether to subscribe to point clouds on points and to publish the positions of targets.',
    )
    cloud_tolerance: float = parameter(
        1e-6,
        'Maximum difference between the stamps of an image and its cloud, s. The default is for '
        'clouds that went through PCL, which keeps whole microseconds; 0: equal stamps.',
        minimum=0.0,
        maximum=MAXIMUM_TOLERANCE,
    )
    cloud_radius: float = parameter(
        NEIGHBOURHOOD,
        'Radius around a centre within which points of the cloud are used, in radii of the dot.',
        minimum=0.5,
        maximum=10.0,
    )
    cloud_offset_x: float = parameter(
        FULL.offset_x,
        'Column of the image that the first column of the cloud belongs to, px.',
        minimum=0.0,
        maximum=100000.0,
    )
    cloud_offset_y: float = parameter(
        FULL.offset_y,
        'Row of the image that the first row of the cloud belongs to, px.',
        minimum=0.0,
        maximum=100000.0,
    )
    cloud_step: float = parameter(
        FULL.step,
        'Distance in the image between neighbouring points of the cloud, px.',
        minimum=0.1,
        maximum=100.0,
    )

    def __post_init__(self) -> None:
        """Refuse values that are not accepted."""
        check_parameters(self)

    @property
    def grid(self) -> CloudGrid:
        """Pixels of the image that the points of the cloud belong to."""
        return CloudGrid(self.cloud_offset_x, self.cloud_offset_y, self.cloud_step)
