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
