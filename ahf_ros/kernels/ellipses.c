/* Edges along rays from the middle of ellipses. */

#include "elementary.h"
#include "kernels.h"

/* How far the strongest steps along m rays of n samples lie outside of ellipses, in their radii,
   and these steps, from dark to bright times a scale, between two bounds. */
void strongest_steps(count k, count m, count n, const float values[k][m][n], const double scale[k],
                     const double radii[k][n], double lowest, double highest, double flat,
                     double displacement[k][m], double strongest[k][m], double steps[n])
{
    for (count i = 0; i < k; i++)
        for (count j = 0; j < m; j++) {
            displacement[i][j] = strongest[i][j] = 0;
            if (n < 5)
                continue;
            count best = 1;
            for (count a = 1; a + 1 < n; a++) {
                float step = (float)((values[i][j][a + 1] - values[i][j][a - 1]) * scale[i]);
                steps[a] = greater(lesser(step, (float)highest), (float)lowest);
                if (steps[a] > steps[best])
                    best = a;
            }
            /* The top is between the steps beside it. */
            best = best < 2 ? 2 : best > n - 3 ? n - 3 : best;
            double before = steps[best - 1], step = steps[best], after = steps[best + 1];
            double shift = 0.5 * (before - after) / lesser(before - 2 * step + after, flat);
            shift = greater(lesser(shift, 1), -1);
            displacement[i][j] = radii[i][best] + shift * (radii[i][1] - radii[i][0]) - 1;
            strongest[i][j] = step;
        }
}
