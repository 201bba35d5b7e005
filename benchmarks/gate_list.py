"""The gates of detectors, in the order in which a dot or an outline comes to them.

A gate is any comparison that drops a candidate, an outline, a dot, a reading or a word. Each is a
name in a module, and comes with the expression with which it does nothing, or as little as can be
computed.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Gate:
    """One gate.

    Attributes
    ----------
    about : str
        What it drops.
    place : str
        Module and name within `ahf_ros`, `module:NAME` or `module:function.local`.
    opened : str
        Expression with which it does nothing, or nearly; `ORIGINAL` is its value.
    """

    about: str
    place: str
    opened: str


_NEVER, _EVERY = "float('-inf')", "float('inf')"


def _without_shares(*rounds: int) -> str:
    """Return the rounds of the fit of ellipses, some without a least share of inliers."""
    return (
        f'[(size, -1 if number in {rounds} else share, every) '
        'for number, (size, share, every) in enumerate(ORIGINAL)]'
    )


def _confidence_without(feature: int) -> str:
    """Return the weights of the confidence of rings without that of one feature."""
    return f'np.where(np.arange(len(ORIGINAL)) == {feature}, 0.0, ORIGINAL)'


_HALF_THE_VOTES = 'ORIGINAL._replace(votes=ORIGINAL.votes / 2)'

_EDGES = [
    Gate('edges without a strong part', 'features.log_edges:_STRONG_EDGE', '0.15'),
    Gate('edges that run straight on', 'features.log_edges:_STRAIGHT', '2.0'),
]

_VOTED = [
    Gate('few votes: dots of 2 to 3.4 px', 'features.candidates:_TINY', _HALF_THE_VOTES),
    Gate('few votes: to 5.8 px', 'features.candidates:_SMALL', _HALF_THE_VOTES),
    Gate('few votes: larger', 'features.candidates:_LARGE', _HALF_THE_VOTES),
    Gate('few votes: oblique', 'features.candidates:_OBLIQUE', _HALF_THE_VOTES),
    Gate('few votes: steep', 'features.candidates:_STEEP', _HALF_THE_VOTES),
    Gate('blocks of few votes', 'features.candidates:_SPREAD', '0.0'),
    Gate('few votes of the cell itself', 'features.candidates:_OWN', '0.0'),
    Gate('cells beside one with more votes', 'features.candidates:_REACH', '0.0'),
    Gate('too many candidates', 'features.candidates:MAXIMUM_CANDIDATES', '10**9'),
    Gate('low steps about a candidate', 'features.ellipses:_MINIMUM_SCORE', '-1.0'),
    Gate('share of inliers, first round', 'features.ellipses:_WINDOWS', _without_shares(0)),
    Gate('second round', 'features.ellipses:_WINDOWS', _without_shares(1)),
    Gate('third round', 'features.ellipses:_WINDOWS', _without_shares(2)),
    Gate('all rounds', 'features.ellipses:_WINDOWS', _without_shares(0, 1, 2)),
    Gate('flat ellipses', 'features.pyramid:MINIMUM_ASPECT', '1e-9'),
    Gate('narrow ellipses', 'features.ellipses:_MINIMUM_MINOR', '0.0'),
    Gate('ellipses beyond their range', 'features.ellipses:_OVERSIZE', _EVERY),
]

_WHOLE = [
    Gate('short outlines', 'features.dot_search:_MINIMUM_LENGTH', '0.0'),
    Gate('long outlines', 'features.dot_search:_MAXIMUM_LENGTH', _EVERY),
    Gate('outlines that are no ellipses', 'features.dot_search:_MAXIMUM_SPREAD', _EVERY),
    Gate('gradients that disagree', 'features.dot_search:_MINIMUM_AGREEMENT', '-1.0'),
    Gate('narrow outlines', 'features.dot_search:_MINIMUM_MINOR', '0.0'),
    Gate('too many outlines', 'features.dot_search:MAXIMUM_OUTLINES', '10**9'),
]

_BLOBS = [
    Gate('blobs of low contrast', 'features.small_dots:_MINIMUM_STEP', '0.07'),
    Gate('blobs of few pixels', 'features.small_dots:_MINIMUM_PIXELS', '1'),
    Gate('blobs that are no ellipses', 'features.small_dots:_FILLED', f'(0.0, {_EVERY})'),
    Gate('larger dots as blobs', 'features.small_dots:LARGEST', '60.0'),
    Gate('too many blobs', 'features.small_dots:MAXIMUM_BLOBS', '10**9'),
]

_DOTS = 'hypotheses.frames[:, :2, 2]'
_ON_DOT = (
    'lambda hypotheses, certain: lambda index: '
    f'np.hypot(*({_DOTS} - {_DOTS}[index]).T) < frame.ellipse_axes(hypotheses.frames)[0][index]'
)

RING = [
    *_WHOLE,
    *_EDGES,
    *_VOTED,
    *_BLOBS,
    Gate('blobs with a wide gap', 'detectors.ring.proposals:_THIN', _EVERY),
    Gate('dots that are another one', 'features.dots:_SAME', '0.0'),
    Gate('edges of whole dots', 'detectors.ring.known:WHOLE', '2.0'),
    Gate('glance: low bounds', 'detectors.ring.proposals:HOPEFUL', _NEVER),
    Gate('votes for dots in known shapes', 'features.shape_votes:_SHARE', '0.1'),
    Gate('most dots in known shapes', 'detectors.ring.proposals:_MOST_ALIKE', '1000'),
    Gate('glance: holes', 'detectors.ring.proposals:_ALIKE', '0.0'),
    Gate('dots with few edges', 'features.circle_fit:ENOUGH', '0.0'),
    Gate('bands without a mark', 'detectors.ring.codewords:_MINIMUM_EVIDENCE', '-1e9'),
    Gate('words that do not compete', 'detectors.ring.codewords:_EXHAUSTIVE', '10**7'),
    Gate('phases that do not compete', 'detectors.ring.codewords:_PHASES', '10'),
    Gate('words after the best ones', 'detectors.ring.codewords:COMPETITORS', '96'),
    Gate('readings without hope', 'detectors.ring.likelihood:HOPEFUL', _NEVER),
    Gate(
        'rivals whose bound is low',
        'detectors.ring.rivals:word_ceilings',
        'lambda gray, dots, band, numbers, prior: '
        'np.full((len(numbers), len(dots.frames)), np.inf)',
    ),
    Gate(
        'words that rivals beat',
        'detectors.ring.rivals:against_rivals',
        'lambda gray, dots, found, families, prior: found',
    ),
    Gate(
        'confidence: margin over the next ID',
        'detectors.ring.confidence:_OF_MARGIN',
        'np.array([9.0, 0.0])',
    ),
    Gate(
        'confidence: arcs of any length',
        'detectors.ring.confidence:_OF_TARGET',
        _confidence_without(2),
    ),
    Gate(
        'confidence: edges in place',
        'detectors.ring.confidence:_OF_TARGET',
        _confidence_without(3),
    ),
    Gate(
        'confidence: share of evidence',
        'detectors.ring.confidence:_OF_TARGET',
        _confidence_without(4),
    ),
    Gate('confidence: bare paper', 'detectors.ring.confidence:_OF_TARGET', _confidence_without(5)),
    Gate(
        'confidence: spots of light',
        'detectors.ring.confidence:_OF_TARGET',
        _confidence_without(6),
    ),
    Gate(
        'confidence: unlike its print',
        'detectors.ring.confidence:_OF_TARGET',
        _confidence_without(7),
    ),
    Gate('low confidence', 'detectors.ring.hypotheses:CERTAIN', '0.05'),
    Gate(
        'dots beyond the bounds of their size',
        'detectors.ring.detector:report.of_size',
        'np.ones(len(major), bool)',
    ),
    Gate(
        'words among foreign bands',
        'detectors.ring.contests:among_others',
        'lambda hypotheses: hypotheses',
    ),
    Gate(
        'prints of several families',
        'detectors.ring.families:settle_same_prints',
        'lambda hypotheses, families: hypotheses',
    ),
    Gate('words in another shape', 'detectors.ring.contests:_ODD', '1.0'),
    Gate('dots on bands', 'detectors.ring.contests:on_targets', _ON_DOT),
    Gate('two claims to an ID, or bands that overlap', 'detectors.ring.contests:_SURER', '0.0'),
    Gate('two claims to a dot', 'detectors.ring.contests:_CLEARLY', '0.0'),
]

GSI = [
    *_WHOLE,
    *_EDGES,
    *_VOTED,
    *_BLOBS,
    Gate('dots that are another one', 'features.dots:_SAME', '0.0'),
    Gate('dots about certain targets', 'detectors.gsi.detector:_MARGIN', '-1.0'),
    Gate('roles other than the reference', 'detectors.gsi.grouping:FEW', '10**6'),
    Gate('radii of dots', 'detectors.gsi.grouping:_RADII', '(0.02, 0.9)'),
    Gate('dots of different size', 'detectors.gsi.grouping:_SIZE_RATIO', '2.0'),
    Gate('crowds', 'detectors.gsi.grouping:_CROWD', '(40.0, 12.5)'),
    Gate('third dots out of place', 'detectors.gsi.grouping:_LENGTH_ERROR', '(0.7, 1.4)'),
    Gate('the same of many', 'detectors.gsi.grouping:_LENGTH_ERROR_OF_MANY', '(0.5, 1.0)'),
    Gate('ellipses of another tilt', 'detectors.gsi.grouping:_ELLIPSE_ERROR', '2.0'),
    Gate('predicted dots out of place', 'detectors.gsi.grouping:_PREDICTED', '1.8'),
    Gate('misfit of a homography', 'detectors.gsi.grouping:_RESIDUAL', '1.4'),
    Gate('too many groups', 'detectors.gsi.grouping:_MAXIMUM_GROUPS', '10**6'),
    Gate('too many templates', 'detectors.gsi.grouping:_MAXIMUM_TEMPLATES', '10**6'),
    Gate('dots at many positions', 'detectors.gsi.grouping:_STRAY', '1000'),
    Gate(
        'templates that are parts of others',
        'detectors.gsi.grouping:_parts_of_others',
        'lambda templates: np.zeros(len(templates.misfit), bool)',
    ),
    Gate('template dots contradicted', 'detectors.gsi.evidence:_CONTRADICTED', _NEVER),
    Gate('implausible codes', 'detectors.gsi.hypotheses:_PLAUSIBLE', '-1.0'),
    Gate('codes that are not obvious', 'detectors.gsi.hypotheses:_CLEAR', '0.75'),
    Gate('clearly worse groups', 'detectors.gsi.hypotheses:_CLEARLY', _EVERY),
    Gate('too many codes', 'detectors.gsi.hypotheses:_MAXIMUM', '10**6'),
    Gate('codes that are not read again', 'detectors.gsi.detector:_PROMISING', '-1.0'),
    Gate('low confidence', 'detectors.gsi.hypotheses:CERTAIN', '0.05'),
]

DOTS = [
    *_WHOLE,
    *_EDGES,
    *_VOTED,
    *_BLOBS,
    Gate('dots that are another one', 'features.dots:_SAME', '0.0'),
    Gate('few edges in four tiles', 'detectors.dots.discs:_MINIMUM_EDGES', '0'),
    Gate('edges that run on for 8 px', 'detectors.dots.discs:_STRAIGHT', '60.0'),
    Gate('low steps of disc and border', 'detectors.dots.discs:_MINIMUM_SHARE', '-1.0'),
    Gate('few edges of disc and border', 'detectors.dots.rings:_PLAUSIBLE', '0.0'),
    Gate('low contrast of a disc', 'detectors.dots.rings:_MAXIMUM_CONTRAST', '2.0'),
    Gate('edges without steps', 'detectors.dots.rings:_MISSING', '2.0'),
    Gate('dots between places', 'detectors.dots.rings:_BETWEEN', _EVERY),
    Gate('low confidence', 'detectors.dots.rings:CERTAIN', '0.05'),
]

SQUARE = [
    Gate('windows of low contrast', 'detectors.square.quadrilaterals:_MINIMUM_STEP', '6'),
    Gate('small sides', 'detectors.square.quadrilaterals:_SMALLEST', '3.0'),
    Gate('regions that are not solid', 'detectors.square.quadrilaterals:_SOLID', '0.0'),
    Gate('tattered regions: outline', 'detectors.square.quadrilaterals:_TATTERED', _EVERY),
    Gate('tattered regions: area', 'detectors.square.quadrilaterals:_FILLED', '0.0'),
    Gate('polygons of many corners', 'detectors.square.quadrilaterals:_MAXIMUM_CORNERS', '60'),
    Gate('short sides', 'detectors.square.quadrilaterals:_FOUR', '0.0'),
    Gate('sides of one line', 'detectors.square.quadrilaterals:_SAME_LINE', '(0.0, 0.0)'),
    Gate('areas unlike the region', 'detectors.square.quadrilaterals:_COMMON_AREA', '(0.0, 1e9)'),
    Gate('sides without steps', 'detectors.square.quadrilaterals:_SIDE', '0.0'),
    Gate('few points of a side', 'detectors.square.quadrilaterals:_FEWEST', '1'),
    Gate('small cells', 'detectors.square.reading:_SMALLEST_CELL', '0.0'),
    Gate('borders that are not dark', 'detectors.square.reading:_SIDE', '0.0'),
    Gate('low contrast of the border', 'detectors.square.reading:_MINIMUM_STEP', '0.05'),
    Gate('low steps of the border', 'detectors.square.reading:_OF_USUAL', _NEVER),
    Gate('impossible markers', 'detectors.square.reading:_POSSIBLE', '-1e9'),
    Gate('unclear markers of low odds', 'detectors.square.reading:_CLEAR', '1e9'),
    Gate('low odds', 'detectors.square.reading:MINIMUM_ODDS', '-4.0'),
    Gate(
        'readings of one place',
        'detectors.square.detector:_SAME_PLACE',
        '0.0',
    ),
    Gate('places of sure markers in halves', 'detectors.square.detector:_SURE', '1e9'),
]

CCTAG = [
    Gate('circles: low steps', 'features.ellipses:_MINIMUM_SCORE', '-1.0'),
    Gate('circles: all rounds', 'features.ellipses:_WINDOWS', _without_shares(0, 1, 2)),
    Gate('too many faint edges', 'detectors.cctag.detector:_MOST_FAINT', '1.0'),
    Gate('glance: little explained', 'detectors.cctag.glance:_PROMISING', '0.0'),
    Gate('glance: worse frames', 'detectors.cctag.glance:_LOOKED_AT', '8'),
    Gate('glance: frames alike', 'detectors.cctag.glance:_APART', '0.0'),
    Gate('rays that differ much', 'detectors.cctag.detector:_ALIKE', '-1.0'),
    Gate('rays that differ', 'detectors.cctag.rings:_SHARED', '-1.0'),
    Gate('rings worse explained', 'detectors.cctag.rings:_CLEARLY', '1.0'),
    Gate('means that no ID explains', 'detectors.cctag.rings:_ALIKE', '-1e9'),
    Gate('IDs that are not tried', 'detectors.cctag.rings:_READINGS', '32'),
    Gate('hopeless targets', 'detectors.cctag.rings:_HOPELESS', '(0.0, 0.0)'),
    Gate('impossible targets', 'detectors.cctag.detector:_POSSIBLE', '0.0'),
    Gate(
        'targets of other families',
        'detectors.cctag.detector:_owned',
        'lambda gray, rings, polarity, family: rings',
    ),
    Gate(
        'IDs that are there twice',
        'detectors.cctag.detector:_single',
        'lambda rings: rings',
    ),
    Gate(
        'targets beside ones that are not read',
        'detectors.cctag.detector:_together',
        'lambda rings: rings',
    ),
    Gate('targets unlike the others', 'detectors.cctag.joint:_HOPELESS', _EVERY),
    Gate('low confidence', 'detectors.cctag.detector:_CERTAIN', '0.05'),
]

GATES = {'ring': RING, 'gsi': GSI, 'dots': DOTS, 'square': SQUARE, 'cctag': CCTAG}
"""The gates by detector."""
