"""The queue of images of the node `detector`: which of them wait, where, and what becomes of them.

Images of a lossless queue wait in memory up to a limit, beyond it on disk. The middleware keeps
what a node does not take, without a bound that ROS 2 could set: a process that was slow to take 60
images of 10 MB grew by 490 MB. So the node takes every message at once.
"""

from __future__ import annotations

import shutil
import tempfile
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import count
from typing import Any, BinaryIO, TypeAlias, TypeVar

from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header

from ahf_ros.base.text import printable
from ahf_ros.files.image_messages import nanoseconds
from ahf_ros.files.target_messages import DROPPED
from ahf_ros.identification.settling import settled_families
from ahf_ros.identification.stream import (
    STATUS,
    Answer,
    Frame,
    Kind,
    Remark,
    message_frame,
    why_refused,
)
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.answers import Answers
from ahf_ros.nodes.diagnostics import Stages, Tally, seconds
from ahf_ros.nodes.pipeline import STOPPING, Pipeline, Stopping
from ahf_ros.nodes.process import LOG_PERIOD, ProcessNode
from ahf_ros.nodes.settings import LOSSLESS

SEGMENT = 64 * 2**20
"""Size beyond which a file is not continued, bytes. Its space is free once all in it was taken."""

RESERVE = 256 * 2**20
"""Space of the disk that is left to others, bytes."""

Result = TypeVar('Result')

ImageMessage: TypeAlias = Image | CompressedImage
"""The messages that images arrive in."""

_REPLACED = 'a newer image took its place before its turn'
_REPLACED_NEXT = 'the next image of its stack was replaced by a newer one'

Take: TypeAlias = Callable[[], ImageMessage]
"""Returns the message that waited; called once."""


@dataclass(frozen=True, slots=True)
class _Waiting:
    """An image that waits for its turn, and what it is identified by."""

    number: int
    take: Take
    pipeline: Pipeline
    arrived: float  # s of the monotonic clock
    header: Header

    @property
    def stamp(self) -> int:
        """Its stamp, ns."""
        return nanoseconds(self.header)

    @property
    def lossless(self) -> bool:
        return self.pipeline.settings.queue == LOSSLESS


class ImageQueue:
    """Identifies the images of a node in the order of their arrival, and publishes the answers.

    Every image has an answer, also one that is refused or dropped; that of a stack is for all of
    its images.

    Every image of a lossless queue waits. Of other images, as many wait as a stack has: a newer
    one takes the place of the oldest, and a stack has no images on both sides of such a gap.
    An image is identified as the parameters are when it arrives.
    """

    def __init__(self, node: ProcessNode, worker: Worker, answers: Answers, tally: Tally) -> None:
        self._logger = node.get_logger()
        self._worker = worker
        self._answers = answers
        self._tally = tally
        self._lock = threading.Lock()
        self._numbers = count(1)
        self._families: tuple[str, ...] = ()  # that are settled
        self.pipeline: Pipeline  # in force
        self._begin()

    def _begin(self) -> None:
        self._waiting: deque[_Waiting] = deque()
        self._messages = WaitingMessages()
        self._last: _Waiting | None = None
        self._overdue = threading.Timer(0.0, self._look)

    def renew(self, pipeline: Pipeline) -> None:
        """Identify the images that arrive from now on by a pipeline; it begins a new stack."""
        self.pipeline = pipeline
        self._worker.append(self._settle)

    def discard(self) -> None:
        """Give up the images that wait."""
        self._worker.discard()
        self.give_up('the node was cleaned up')

    def give_up(self, why: str) -> None:
        """Answer the images that wait with the reason why they are not identified.

        The worker must have stopped.
        """
        waiting, last = self._waiting, self._last
        self._begin()
        if last:
            self._drop(last.pipeline, last.pipeline.stream.forget(), why)
        for image in waiting:
            self._drop(image.pipeline, (image.header,), why)

    def put(self, message: ImageMessage) -> None:
        """Let an image wait for its turn."""
        self._count(message)
        pipeline = self.pipeline
        settings = pipeline.settings
        take: Take = [message].pop  # keeps nothing
        header, given_up = message.header, ''
        if settings.queue == LOSSLESS:
            try:
                take = self._messages.put(message, settings.queue_memory * 2**20)
            except ValueError as error:
                self._refuse(pipeline, why_refused(error, Kind.DROPPED, (header,)))
                return
        with self._lock:
            arrived = time.monotonic()
            image = _Waiting(next(self._numbers), take, pipeline, arrived, header)
            replaceable = [] if image.lossless else [it for it in self._waiting if not it.lossless]
            self._waiting.append(image)
            if len(replaceable) < settings.stacking.stack:
                if self._worker.append(self._identify_next).cancelled():
                    self._waiting.remove(image)
                    given_up = STOPPING
            else:  # it takes the turn of the oldest one
                image = replaceable[0]
                self._waiting.remove(image)
                self._tally.dropped += 1
                self._tally.behind += 1
                given_up = _REPLACED
        if given_up:
            self._drop(image.pipeline, (image.header,), given_up)

    def refuse(self, header: Header, error: Exception) -> None:
        """Answer an image that did not even become a message, with the reason."""
        self._tally.received += 1
        self._refuse(self.pipeline, why_refused(error, items=(header,)))

    def identify(self, message: ImageMessage, expected: int | None = None) -> CodedTargetArray:
        """Identify an image out of turn; called in the thread of the worker.

        Without `expected`, N is that of the parameters. Raises a ValueError if the image is
        refused, which is counted and logged, or if the node stops.
        """
        pipeline = self.pipeline
        try:
            frame = message_frame(message)
            if frame.damage:
                said = f'the image is damaged: {frame.damage}'
                self._tell(Remark(Kind.DAMAGED, said), frame.stamp)
            return pipeline.message(pipeline.stream.identify(frame, expected))
        except Stopping:
            raise
        except Exception as error:
            remark = why_refused(error)
            self._tell(remark, nanoseconds(message.header))
            raise ValueError(remark.text) from error

    def _count(self, message: ImageMessage) -> None:
        self._tally.received += 1
        if backwards := self._tally.compare_stamps(message.header):
            self._logger.warning(backwards, throttle_duration_sec=LOG_PERIOD)
        kind = getattr(message, 'format', '')
        if not kind:
            kind = f'{message.width} x {message.height} px, {message.encoding}'
        if changed := self._tally.compare_kinds(kind):
            self._logger.warning(changed, throttle_duration_sec=LOG_PERIOD)

    def _identify_next(self) -> None:
        """Identify the image that has waited longest, or add it to its stack."""
        with self._lock:
            image = self._waiting.popleft()
        last, self._last = self._last, image
        stream = image.pipeline.stream
        if last and last.pipeline is not image.pipeline:
            self._end(last, 'parameters changed')
        elif last and last.number != image.number - 1:
            given_up = stream.forget()
            self._tally.dropped += len(given_up)
            self._drop(image.pipeline, given_up, _REPLACED_NEXT)
        self._overdue.cancel()
        stages = Stages(image.arrived)
        stages.end('waiting')

        def read() -> Frame[Header]:
            frame = message_frame(image.take())
            stages.end('conversion')
            return frame

        self._handle(image, stream.add(read, image.header), stages)
        if stream.waiting:
            self._expect(image.pipeline.settings.stack_timeout)
        with self._lock:
            if not self._waiting:
                self._tally.behind = 0

    def _settle(self) -> None:
        """End a stack that was begun with other parameters."""
        if self._last and self._last.pipeline is not self.pipeline:
            self._end(self._last, 'parameters changed')

    def _expect(self, limit: float) -> None:
        """End the stack if its next image does not come in time, s.

        This is no timer of rclpy, which ends the node where one thread cancels a timer that is due
        while another is about to call it.
        """
        self._overdue = threading.Timer(limit, self._look)
        self._overdue.daemon = True
        self._overdue.start()

    def _look(self) -> None:
        self._worker.append(self._end_overdue)

    def _end_overdue(self) -> None:
        last = self._last
        if last and last.pipeline.stream.waiting:
            limit = last.pipeline.settings.stack_timeout
            if time.monotonic() - last.arrived > limit:
                self._end(last, f'no image followed for {limit:g} s')

    def _end(self, last: _Waiting, why: str) -> None:
        stages = Stages(last.arrived)
        stages.end('waiting')
        self._handle(last, last.pipeline.stream.end(why), stages)

    def _handle(
        self, image: _Waiting, said: Iterable[Answer[Header] | Remark], stages: Stages
    ) -> None:
        """Publish the answers of a stream, and tell its remarks."""
        for it in said:
            if not isinstance(it, Remark):
                self._publish(it, image, stages)
            elif isinstance(it.error, Stopping):
                self._drop(image.pipeline, it.items, STOPPING)
            elif it.items:
                self._refuse(image.pipeline, it)
            else:
                self._tell(it, image.stamp)

    def _publish(self, answer: Answer[Header], image: _Waiting, stages: Stages) -> None:
        stages.end('identification')
        try:
            self._answers.publish(answer, image.pipeline, stages)
            memory = image.pipeline.stream.memory
            if line := settled_families(memory, self._families):
                self._logger.info(line)
            self._families = memory.families
        except Exception as error:
            # No image may end the node.
            self._tell(why_refused(error), image.stamp)

    def _refuse(self, pipeline: Pipeline, remark: Remark) -> None:
        """Tell a remark on images that get no answer of a stream, and answer them with it."""
        for header in remark.items:
            self._tell(remark, nanoseconds(header))
            status = STATUS[remark.kind]
            self._answers.give_up(pipeline.unanswered(header, status, remark.text))

    def _drop(self, pipeline: Pipeline, headers: Iterable[Header], why: str) -> None:
        """Answer images that were not looked at."""
        for header in headers:
            self._answers.give_up(pipeline.unanswered(header, DROPPED, why))

    def _tell(self, remark: Remark, stamp: int) -> None:
        """Count and log a remark on an image with a stamp, ns."""
        if remark.kind == Kind.INCOMPLETE:
            self._tally.incomplete += 1
            self._logger.warning(remark.text, throttle_duration_sec=LOG_PERIOD)
        elif remark.kind == Kind.SPLIT:
            self._tally.split += 1
            self._logger.warning(remark.text, throttle_duration_sec=LOG_PERIOD)
        elif remark.kind == Kind.DAMAGED:
            self._tally.damaged += 1
            self._tally.damage = f'{remark.text}, stamp {seconds(stamp)}'
            self._logger.warning(self._tally.damage, throttle_duration_sec=LOG_PERIOD)
        else:
            self._tally.rejected += 1
            self._tally.reason = remark.text
            if remark.error and not isinstance(remark.error, ValueError):
                lines = ''.join(traceback.format_exception(remark.error)).splitlines()
                self._logger.error('\n'.join(map(printable, lines)))
            text = f'image refused: {remark.text}, stamp {seconds(stamp)}'
            self._logger.warning(text, throttle_duration_sec=LOG_PERIOD)


class Worker:
    """Runs jobs in order, one at a time, in a thread of its own; while it is paused, they wait."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(max_workers=1)
        self._turn = threading.Condition()  # held while a job runs
        self._paused = self._stopped = False
        self._last: Future[Any] | None = None

    @property
    def busy(self) -> bool:
        """Whether a job runs or waits."""
        return self._last is not None and not self._last.done()

    def append(self, job: Callable[[], Result]) -> Future[Result]:
        """Run `job`, unless the worker is stopped first, which cancels it."""
        future: Future[Result]
        try:
            future = self._last = self._thread.submit(self._in_turn, job)
        except RuntimeError:  # stopped
            future = Future()
            future.cancel()
        return future

    def call(self, job: Callable[[], Result]) -> Result:
        """Run `job` and return its result, or raise its error.

        Raises a `concurrent.futures.CancelledError` if the worker is stopped before its turn.
        """
        return self.append(job).result()

    def pause(self) -> None:
        """Let jobs wait, and return when the running one has ended."""
        self._paused = True
        with self._turn:
            pass

    def resume(self) -> None:
        """Run the jobs that wait."""
        with self._turn:
            self._paused = False
            self._turn.notify()

    def discard(self) -> None:
        """Drop the waiting jobs and return when the running one has ended; the worker goes on."""
        self.stop()
        self._paused = self._stopped = False
        self._thread = ThreadPoolExecutor(max_workers=1)

    def stop(self) -> None:
        """Drop the waiting jobs and return when the running one has ended."""
        self._stopped = True
        with self._turn:
            self._turn.notify()
        self._thread.shutdown(cancel_futures=True)

    def _in_turn(self, job: Callable[[], Result]) -> Result:
        with self._turn:
            self._turn.wait_for(lambda: self._stopped or not self._paused)
            if self._stopped:
                raise CancelledError
            return job()


class _Segment:
    """A file without a name that holds messages one after the other."""

    def __init__(self) -> None:
        self.file: BinaryIO = tempfile.TemporaryFile()  # noqa: SIM115
        self.size = 0
        self.waiting = 0


class WaitingMessages:
    """Messages that wait, in bounded memory and without loss."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._memory = 0
        self._segment: _Segment | None = None

    def put(self, message: Any, limit: int) -> Take:
        """Keep a message until it is taken.

        Waiting messages may take `limit` bytes of memory together; one may always wait. Raises a
        ValueError if it would have to wait on disk and there is no space.
        """
        size = len(message.data)
        with self._lock:
            if not self._memory or self._memory + size <= limit:
                self._memory += size
                return partial(self._taken, [message], size)
        return self._written(type(message), serialize_message(message))

    def _taken(self, kept: list[Any], size: int) -> Any:
        with self._lock:
            self._memory -= size
        return kept.pop()

    def _written(self, kind: type, data: bytes) -> Take:
        free = shutil.disk_usage(tempfile.gettempdir()).free
        if free < len(data) + RESERVE:
            raise ValueError(
                f'the queue is full: queue_memory is used up and {tempfile.gettempdir()} has '
                f'{free} bytes left, accepted are at least {len(data) + RESERVE}'
            )
        with self._lock:
            segment = self._segment
            if segment is None or segment.size > SEGMENT:
                segment = self._segment = _Segment()
            place = segment.size
            segment.file.seek(place)
            segment.file.write(data)
            segment.size += len(data)
            segment.waiting += 1
        return partial(self._read, kind, segment, place, len(data))

    def _read(self, kind: type, segment: _Segment, place: int, size: int) -> Any:
        with self._lock:
            segment.file.seek(place)
            data = segment.file.read(size)
            segment.waiting -= 1
            if not segment.waiting:
                # Nothing in it waits: the next message that has to begins another file.
                segment.file.close()
                if segment is self._segment:
                    self._segment = None
        return deserialize_message(data, kind)
