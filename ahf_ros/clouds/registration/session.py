"""What is registered so far, and how it is taken back."""

from ahf_ros.base.blas import one_blas_thread
from ahf_ros.clouds.registration.adjustment import Adjusted, adjusted
from ahf_ros.clouds.registration.field import Field, RegisteredScan, added, known_field
from ahf_ros.clouds.registration.scan import Scan
from ahf_ros.network.points import MeasuredPoints


class Registration:
    """A field that scans are added to, one after the other.

    The number of threads of BLAS changes no bit of it.
    """

    def __init__(self, known: MeasuredPoints | None = None) -> None:
        self._states = [known_field(known)]

    @property
    def field(self) -> Field:
        """The field with all its scans."""
        return self._states[-1]

    def add(self, scan: Scan) -> RegisteredScan:
        """Register a scan; a ValueError says why it does not fit, and nothing changes."""
        with one_blas_thread():
            self._states.append(added(self.field, scan))
        return self.field.scans[-1]

    def adjust(self) -> Adjusted:
        """Adjust all scans and targets jointly; a ValueError says why that is not possible."""
        with one_blas_thread():
            result = adjusted(self.field)
        self._states.append(result.field)
        return result

    def undo(self) -> bool:
        """Take back the last scan or adjustment; return whether it was a scan.

        A ValueError says so if there is none.
        """
        if len(self._states) == 1:
            raise ValueError('nothing is registered, so that there is nothing to undo')
        last = self._states.pop()
        return len(last.scans) > len(self.field.scans)

    def reset(self) -> None:
        """Forget all scans; known coordinates stay."""
        del self._states[1:]
