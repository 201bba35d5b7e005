"""The node `scoreboard`: how well the targets of every image were identified."""

from ahf_ros.files.image_messages import nanoseconds
from ahf_ros.files.target_messages import identification_from, is_answered
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.parameters import ParameterSettings
from ahf_ros.nodes.process import ProcessNode
from ahf_ros.nodes.settings import ScoreboardSettings
from ahf_ros.scenes.evaluation import line

KEPT = 1000
"""Number of truths that wait for the answer to their image."""


class Scoreboard(ProcessNode):
    """Compares what was identified with the truth and prints one line per image."""

    def __init__(self) -> None:
        super().__init__('scoreboard')
        self._settings = ParameterSettings(self, ScoreboardSettings)
        self._truths: dict[int, CodedTargetArray] = {}  # by the stamp of their image, ns
        self._count = 0
        self.subscribe(CodedTargetArray, 'ground_truth', self._on_truth)
        self.subscribe(CodedTargetArray, 'coded_targets', self._on_targets)

    def introduction(self) -> str:
        """Return which topics are compared."""
        topics = [self.resolve_topic_name(it) for it in ('coded_targets', 'ground_truth')]
        return f'compares {topics[0]} with {topics[1]}'

    def _on_truth(self, message: CodedTargetArray) -> None:
        self._truths[nanoseconds(message.header)] = message
        if len(self._truths) > KEPT:
            del self._truths[next(iter(self._truths))]

    def _on_targets(self, message: CodedTargetArray) -> None:
        images = self._settings.current.images
        truth = self._truths.get(nanoseconds(message.header))
        if not is_answered(message) or truth is None or (images and self._count >= images):
            return
        self._count += 1
        words = line(identification_from(message), identification_from(truth).targets)
        print(f'image {self._count}: {words}', flush=True)
        if self._count == images:
            self.ended.set_result(0)
