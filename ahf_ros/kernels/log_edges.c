/* Edge pixels of logarithmic images. */

#include <math.h>

#include "elementary.h"
#include "kernels.h"

/* An index beyond an array of n is that of its mirror image, whose middle is the first or last. */
static inline count mirrored(count i, count n)
{
    return within(i < 0 ? -i : i < n ? i : 2 * n - 2 - i, n);
}

/* The gradient at a pixel, in whole units (Scharr, 2000). */
static inline void gradient_at(count h, count w, const int16_t log[h][w], count x, count y,
                               float scale, float gradient[2])
{
    count left = mirrored(x - 1, w), right = mirrored(x + 1, w);
    const int16_t *above = log[mirrored(y - 1, h)], *own = log[y], *below = log[mirrored(y + 1, h)];
    int sums[2] = {
        3 * (above[right] - above[left] + below[right] - below[left]) +
            10 * (own[right] - own[left]),
        3 * (below[left] - above[left] + below[right] - above[right]) + 10 * (below[x] - above[x]),
    };
    for (int axis = 0; axis < 2; axis++)
        gradient[axis] = (float)lrintf(lesser_f(greater_f((float)sums[axis] * scale, -32768), 32767));
}

void bent_edges(count h, count w, rows k, const int16_t log[h][w], const int32_t x[k],
                const int32_t y[k], const float unit_x[k], const float unit_y[k],
                const float strength[k], float scale, float length, float continued,
                float straight, bool bent[k])
{
    for (count i = 0; i < k; i++) {
        bent[i] = false;
        for (int way = 1; way >= -1 && !bent[i]; way -= 2) {
            float column = (float)x[i] - (float)way * length * unit_y[i], gradient[2];
            float row = (float)y[i] + (float)way * length * unit_x[i];
            count at_x = within(lrintf(lesser_f(greater_f(column, -1), 1e9f)), w);
            count at_y = within(lrintf(lesser_f(greater_f(row, -1), 1e9f)), h);
            gradient_at(h, w, log, at_x, at_y, scale, gradient);
            float along = gradient[0] * unit_x[i] + gradient[1] * unit_y[i];
            float square = gradient[0] * gradient[0] + gradient[1] * gradient[1];
            bent[i] = !(along > continued * strength[i] && along * along > straight * square);
        }
    }
}
