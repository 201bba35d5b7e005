/* Closed outlines of whole pixels, one after the other, each up to its end among n points. */

#include <math.h>

#include "elementary.h"
#include "kernels.h"

/* The points of one outline, from the first one to before the last one. */
struct span {
    count first, last;
};

static struct span span_of(count n, count k, const int64_t ends[k], count i)
{
    count last = within(ends[i], n + 1), first = i ? within(ends[i - 1], n + 1) : 0;
    return (struct span){first < last ? first : last, last};
}

void outline_sizes(count n, count k, const int32_t points[n][2], const int64_t ends[k],
                   double areas[k], double lengths[k], int64_t boxes[k][2])
{
    for (count i = 0; i < k; i++) {
        struct span of = span_of(n, k, ends, i);
        areas[i] = lengths[i] = 0;
        for (int axis = 0; axis < 2; axis++) {
            int64_t low = of.first < of.last ? points[of.first][axis] : 0, high = low;
            for (count j = of.first; j < of.last; j++) {
                low = points[j][axis] < low ? points[j][axis] : low;
                high = points[j][axis] > high ? points[j][axis] : high;
            }
            boxes[i][axis] = high - low + 1;
        }
        for (count j = of.first; j < of.last; j++) {
            const int32_t *one = points[j], *next = points[j + 1 < of.last ? j + 1 : of.first];
            double x = (double)next[0] - one[0], y = (double)next[1] - one[1];
            areas[i] += ((double)one[0] * next[1] - (double)one[1] * next[0]) / 2;
            lengths[i] += sqrt(x * x + y * y);
        }
    }
}

void side_lines(count n, count k, const int32_t points[n][2], const int64_t ends[k],
                const double sides[k][4][2][2], const double near[k], const double outwards[k],
                double middle, double least, double lines[k][4][2][2], double fewest[k])
{
    for (count i = 0; i < k; i++) {
        struct span of = span_of(n, k, ends, i);
        fewest[i] = HUGE_VAL;
        for (int side = 0; side < 4; side++) {
            const double(*end)[2] = sides[i][side];
            double x = end[1][0] - end[0][0], y = end[1][1] - end[0][1];
            double length = sqrt(x * x + y * y), normal[2] = {y / length, -x / length};
            double total = 0, place = 0, away = 0, squares = 0, products = 0;
            for (count j = of.first; j < of.last; j++) {
                double across = points[j][0] - end[0][0], down = points[j][1] - end[0][1];
                double at = (x * across + y * down) / (length * length) - 0.5;
                double offset = normal[0] * across + normal[1] * down;
                if (fabs(offset) < near[i] && fabs(at) < middle) {
                    total += 1, place += at, away += offset;
                    squares += at * at, products += at * offset;
                }
            }
            fewest[i] = lesser(total, fewest[i]);
            place /= greater(total, 1), away /= greater(total, 1);
            double slope = (products - total * place * away) /
                           greater(squares - total * place * place, least);
            for (int last = 0; last < 2; last++)
                for (int axis = 0; axis < 2; axis++)
                    lines[i][side][last][axis] =
                        end[last][axis] +
                        (away + outwards[i] + slope * ((last ? 0.5 : -0.5) - place)) * normal[axis];
        }
    }
}
