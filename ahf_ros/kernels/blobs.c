/* Blobs: pixels that are set, and connected along rows and columns.

   Rows are read one after the other, as runs of pixels. Of the runs of two rows, each knows the blob
   that it is a part of, so far; a blob without a run in the second one is complete. */

#include <string.h>

#include "kernels.h"

/* Of a run, and of the blob that it owns: pixels, sums of their places, the first pixel, columns,
   and the highest value. Owners own themselves. In the next row a blob is a part of another one. */
enum { START, END, OWNER, NEXT, SIZE, X, Y, XX, XY, YY, FIRST, LEFT, RIGHT, HIGHEST, FIELDS };

typedef int64_t run[FIELDS];

static inline int64_t lesser_of(int64_t a, int64_t b) { return a < b ? a : b; }
static inline int64_t greater_of(int64_t a, int64_t b) { return a > b ? a : b; }

/* The first pixel of a row, from one on, that is set, or is not; `w` if there is none. */
static inline count next(count w, const bool set[w], count from, bool wanted)
{
    const bool *found = from < w ? memchr(set + from, wanted, (size_t)(w - from)) : NULL;
    return found ? found - set : w;
}

/* The sum of squares of the whole numbers below one. */
static inline int64_t squares_below(int64_t n) { return (n - 1) * n * (2 * n - 1) / 6; }

static void set_run(count w, count row, count number, count start, count end,
                    const uint8_t values[w], run of)
{
    int64_t size = end - start, x = size * (start + end - 1) / 2, highest = 0;
    for (count column = start; column < end; column++)
        highest = greater_of(highest, values[column]);
    memcpy(of,
           (run){start, end, number, -1, size, x, size * row,
                 squares_below(end) - squares_below(start), x * row, size * row * row,
                 row * w + start, start, end - 1, highest},
           sizeof(run));
}

static void add(const run of, run to)
{
    for (int field = SIZE; field <= YY; field++)
        to[field] += of[field];
    to[FIRST] = lesser_of(to[FIRST], of[FIRST]);
    to[LEFT] = lesser_of(to[LEFT], of[LEFT]);
    to[RIGHT] = greater_of(to[RIGHT], of[RIGHT]);
    to[HIGHEST] = greater_of(to[HIGHEST], of[HIGHEST]);
}

static int64_t owner_of(run runs[], int64_t own)
{
    while (runs[own][OWNER] != own)
        own = runs[own][OWNER] = runs[runs[own][OWNER]][OWNER];
    return own;
}

/* The blob of a run is also the blob of one that touches it in the next row. */
static void join(run runs[], int64_t own, run others[], int64_t touching)
{
    int64_t blob = owner_of(runs, own), other = owner_of(others, touching);
    if (runs[blob][NEXT] < 0) {
        add(runs[blob], others[other]);
        runs[blob][NEXT] = other;
        return;
    }
    int64_t same = owner_of(others, runs[blob][NEXT]);
    if (same != other) {
        add(others[other], others[same]);
        others[other][OWNER] = same;
    }
}

void blobs(count h, count w, count most, const bool set[h][w], const uint8_t values[h][w],
           int64_t fewest, int64_t longest, int64_t first[most], int64_t size[most],
           int64_t length[most], uint8_t highest[most], double moments[5][most],
           int64_t scratch[2][w][14])
{
    count found = 0, before = 0;
    for (count row = 0; row <= h; row++) {
        run *last = scratch[(row + 1) % 2], *now = scratch[row % 2];
        count n = 0, start = row < h ? next(w, set[row], 0, true) : w;
        for (count near = 0; start < w; n++) {
            count end = next(w, set[row], start, false);
            set_run(w, row, n, start, end, values[row], now[n]);
            while (near < before && last[near][END] <= start)
                near++;
            for (count touching = near; touching < before && last[touching][START] < end; touching++)
                join(last, touching, now, n);
            start = next(w, set[row], end, true);
        }
        for (count own = 0; own < before && found < most; own++) {
            const int64_t *of = last[own];
            int64_t pixels = of[SIZE], left = of[LEFT], top = of[FIRST] / w;
            int64_t side = greater_of(of[RIGHT] + 1 - left, row - top);
            if (of[OWNER] != own || of[NEXT] >= 0 || pixels < fewest || side > longest)
                continue;
            int64_t x = of[X] - pixels * left, y = of[Y] - pixels * top;
            int64_t xx = of[XX] - left * (of[X] + x), yy = of[YY] - top * (of[Y] + y);
            int64_t xy = of[XY] - left * of[Y] - top * x;
            double number = (double)pixels, square = number * number;
            first[found] = of[FIRST];
            size[found] = pixels;
            length[found] = side;
            highest[found] = (uint8_t)of[HIGHEST];
            moments[0][found] = (double)left + (double)x / number;
            moments[1][found] = (double)top + (double)y / number;
            moments[2][found] = (double)(pixels * xx - x * x) / square;
            moments[3][found] = (double)(pixels * xy - x * y) / square;
            moments[4][found] = (double)(pixels * yy - y * y) / square;
            found++;
        }
        before = n;
    }
    for (; found < most; found++)
        size[found] = 0;
}
