"""Two reports of `benchmarks.identification` side by side, and what has become worse.

`python -m benchmarks.identification --compare BEFORE.json` prints it. Times are comparable only if
both were measured on the same machine, one after the other. The time in multiples of the plain
search for contours depends less on the machine.
"""

from statistics import median

from benchmarks.report import Report, number, table

TARGETS = 1
"""Targets that a row may lose: last bits decide on the weakest one."""

SLOWER = 1.05
"""Ratio of times, the median of all rows, that is not worse yet."""

SAME = ('width', 'height', 'seeds')
"""What two reports must share."""


def check_comparable(before: Report, after: Report) -> None:
    """Raise ValueError if two reports are of different images."""
    for name in SAME:
        if before[name] != after[name]:
            raise ValueError(f'{name} is {after[name]}, accepted is {before[name]} as before')


def pairs(before: Report, after: Report) -> list[tuple[Report, Report]]:
    """Return the rows that both reports have, in the order of the second.

    Raises
    ------
    ValueError
        If the reports are of different images, or have no row in common.
    """
    check_comparable(before, after)
    known = {(row['group'], row['name']): row for row in before['rows']}
    both = [
        (known[row['group'], row['name']], row)
        for row in after['rows']
        if (row['group'], row['name']) in known
    ]
    if not both:
        raise ValueError('the reports have no row in common, accepted is at least one')
    return both


def worse(before: Report, after: Report) -> list[str]:
    """Return what has become worse, a line for each finding."""
    found = []
    both = pairs(before, after)
    for old, new in both:
        where = f'{new["group"]}, {new["name"]}'
        if new['expected'] != old['expected']:
            found.append(f'{where}: {new["expected"]} targets shown, {old["expected"]} before')
        if new['right'] < old['right'] - TARGETS:
            found.append(f'{where}: {new["right"]} right, {old["right"]} before')
        for name, words in (('wrong', 'wrong'), ('false_positives', 'false positives')):
            if new[name] > old[name]:
                found.append(f'{where}: {new[name]} {words}, {old[name]} before')
    ratio = median(times(old, new)[0] for old, new in both)
    if ratio > SLOWER:
        found.append(f'time: {ratio:.2f} times that of before, in the median of all rows')
    return found


def times(old: Report, new: Report) -> tuple[float, float]:
    """Return the ratio of the times of a row, in s and in multiples of the search for contours."""
    return new['seconds'] / old['seconds'], new['times_contours'] / old['times_contours']


def markdown(before: Report, after: Report) -> str:
    """Return the rows that both reports have as one table, with totals and findings below."""
    both = pairs(before, after)
    head = ('', '', 'N', 'right', 'wrong', 'false', 'RMSE XY (px)', 's', 'time', '/ contours')
    rows = [
        (
            new['group'],
            new['name'],
            new['expected'],
            *(f'{old[key]}, {new[key]}' for key in ('right', 'wrong', 'false_positives')),
            f'{number(old["rmse_xy"], 4)}, {number(new["rmse_xy"], 4)}',
            f'{number(old["seconds"], 2)}, {number(new["seconds"], 2)}',
            *(number(ratio, 2) for ratio in times(old, new)),
        )
        for old, new in both
    ]
    old_sum, new_sum = (
        [sum(row[key] for row in rows) for key in ('right', 'wrong', 'false_positives', 'seconds')]
        for rows in zip(*both, strict=True)
    )
    ratios = [median(column) for column in zip(*(times(*pair) for pair in both), strict=True)]
    lines = [
        f'{after["method"]}, {after["width"]} x {after["height"]} px, seeds '
        f'{", ".join(map(str, after["seeds"]))}: before, after. Times are ratios after / before.',
        '',
        *table(head, rows),
        '',
        f'{len(both)} rows: right {old_sum[0]}, {new_sum[0]}; wrong {old_sum[1]}, {new_sum[1]}; '
        f'false {old_sum[2]}, {new_sum[2]}; {old_sum[3]:.2f} s, {new_sum[3]:.2f} s; '
        f'median ratio of times {ratios[0]:.2f}, in multiples of contours {ratios[1]:.2f}.',
    ]
    missing = len(before['rows']) - len(both)
    if missing:
        lines.append(f'{missing} rows of before were not measured again.')
    findings = worse(before, after)
    lines += ['', 'Worse:' if findings else 'Nothing is worse.', *findings]
    return '\n'.join(lines)
