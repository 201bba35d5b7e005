/* The ink of rings along the radius of a CCTag. */

#include <math.h>

#include "cctag.h"
#include "kernels.h"
#include "robust.h"

/* Ink of circles, and its changes by the radius, by the shift and by ln of the blur, times a share.

   Blur moves what lies near to the centre outwards (Rice). */
static void add_circles(count c, count n, const double circles[c], double size, double shift,
                        double blur, const float along[n], float share, float by_blur,
                        float *const inks[4])
{
    float over = (float)(1 / blur), wide = (float)size, moved = (float)squared(blur / size);
    for (count i = 0; i < c; i++) {
        float sign = circles[i] < 0 ? -1 : circles[i] > 0;
        float radius = (float)(fabs(circles[i]) * size + sign * shift);
        for (count j = 0; j < n; j++) {
            float away = (radius - sqrtf(along[j] * along[j] + moved) * wide) * over;
            float power = bell_f(away);
            float density = share * sign * power * 0.39894228f;
            inks[0][j] += share * sign * normal_share_f(away, power);
            inks[1][j] -= density * wide * over;
            inks[2][j] += density * sign * over;
            inks[3][j] -= density * away * by_blur;
        }
    }
}

void cctag_rings(rows k, count c, count n, const double circles[k][c], const double size[k],
                 const double shift[k], const double blur[k], const double sharpening[k],
                 const float along[n], double mask, float ink[k][n], float by_radius[k][n],
                 float by_shift[k][n], float by_blur[k][n], float by_sharpening[k][n],
                 float row[2][n])
{
    for (count i = 0; i < k; i++) {
        float *const inks[4] = {ink[i], by_radius[i], by_shift[i], by_blur[i]};
        double more = sharpening[i], wide = sqrt(squared(blur[i]) + squared(mask));
        for (count j = 0; j < n; j++)
            ink[i][j] = by_radius[i][j] = by_shift[i][j] = by_blur[i][j] = 0;
        add_circles(c, n, circles[i], size[i], shift[i], wide, along, 1,
                    (float)squared(blur[i] / wide), inks);
        for (count j = 0; j < n; j++)
            row[0][j] = ink[i][j];
        for (int of = 0; of < 4; of++)
            for (count j = 0; j < n; j++)
                inks[of][j] *= (float)-more;
        for (count j = 0; j < n; j++)
            row[1][j] = ink[i][j];
        add_circles(c, n, circles[i], size[i], shift[i], blur[i], along, (float)(1 + more), 1, inks);
        for (count j = 0; j < n; j++)
            by_sharpening[i][j] = (ink[i][j] - row[1][j]) / (float)(1 + more) - row[0][j];
    }
}
