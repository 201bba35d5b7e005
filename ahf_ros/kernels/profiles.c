/* Edges measured in gray values, on profiles across the outlines of prints. */

#include <math.h>

#include "elementary.h"
#include "kernels.h"

/* Where outlines have edges in images of their plane: places, px, normals outwards, px a unit
   across the edge, px to the next point, and curvature, 1/px. */
void edge_points(rows k, count m, const double frames[k][3][3], const double points[m][2],
                 const double normals[m][2], const double curvature[m], const double spacing[m],
                 double no_length, double images[k][m][2], double outwards[k][m][2],
                 double scale[k][m], double distance[k][m], double bend[k][m])
{
    for (count i = 0; i < k; i++)
        for (count j = 0; j < m; j++) {
            const double *p = points[j], *n = normals[j];
            double image[3], across[3], along[3];
            for (int row = 0; row < 3; row++) {
                const double *f = frames[i][row];
                image[row] = f[0] * p[0] + f[1] * p[1] + f[2];
                across[row] = f[0] * n[0] + f[1] * n[1];
                along[row] = f[1] * n[0] - f[0] * n[1];
            }
            for (int row = 0; row < 2; row++) {
                images[i][j][row] = image[row] / image[2];
                across[row] = (across[row] - images[i][j][row] * across[2]) / image[2];
                along[row] = (along[row] - images[i][j][row] * along[2]) / image[2];
            }
            double length = sqrt(along[0] * along[0] + along[1] * along[1]);
            length = length > no_length ? length : no_length;
            double area = across[0] * along[1] - across[1] * along[0];
            outwards[i][j][0] = along[1] / length;
            outwards[i][j][1] = -along[0] / length;
            scale[i][j] = area / length > no_length ? area / length : no_length;
            distance[i][j] = spacing[j] * length;
            bend[i][j] = curvature[j] * area / (length * length * length);
        }
}

/* The group of each profile, its blur times the number of widths plus its width, the longest one
   that reach and image allow. Width 0 stands for none. */
void profile_groups(count k, count m, count w, const double points[k][m][2],
                    const double normals[k][m][2], const int16_t polarity[k][m],
                    const double scale[k][m], const double reach[k], const double enough[k],
                    const int32_t blurs[k], const double half_widths[w], double right,
                    double bottom, int32_t groups[k][m])
{
    for (count i = 0; i < k; i++)
        for (count j = 0; j < m; j++) {
            double length = reach[i] * scale[i][j];
            length = length < enough[i] ? length : enough[i];
            count width = 0;
            while (polarity[i][j] && width + 1 < w && half_widths[width + 1] <= length)
                width++;
            double x = points[i][j][0], across = fabs(half_widths[width] * normals[i][j][0]);
            double y = points[i][j][1], down = fabs(half_widths[width] * normals[i][j][1]);
            if (!(x - across >= 0 && x + across <= right && y - down >= 0 && y + down <= bottom))
                width = 0;
            groups[i][j] = (int32_t)within((int64_t)blurs[i] * w + width, INT32_MAX);
        }
}

enum { SAMPLES = 13, LINES = 2, OFFSETS = 17, PARTS = 5 };

/* Sample profiles of straight lines, `aside` of their middle to both sides, between pixels; beyond
   the border the nearest pixel counts. */
static inline void sample_profile(count h, count w, const float gray[h][w], const double point[2],
                                  const double way[2], double aside, double half,
                                  const double along[SAMPLES], float profile[SAMPLES])
{
    double x[LINES][SAMPLES], y[LINES][SAMPLES];
    int32_t left[LINES][SAMPLES], top[LINES][SAMPLES];
    float across[LINES][SAMPLES], down[LINES][SAMPLES];
    for (int line = 0; line < LINES; line++)
        for (int a = 0; a < SAMPLES; a++) {
            double beside = line ? aside : -aside;
            x[line][a] = point[0] + half * along[a] * way[0] + beside * way[1];
            y[line][a] = point[1] + half * along[a] * way[1] - beside * way[0];
            x[line][a] = lesser(greater(x[line][a], 0), (double)(w - 1));
            y[line][a] = lesser(greater(y[line][a], 0), (double)(h - 1));
            left[line][a] = (int32_t)x[line][a];
            top[line][a] = (int32_t)y[line][a];
            across[line][a] = (float)(x[line][a] - left[line][a]);
            down[line][a] = (float)(y[line][a] - top[line][a]);
        }
    for (int a = 0; a < SAMPLES; a++)
        profile[a] = 0;
    for (int line = 0; line < LINES; line++)
        for (int a = 0; a < SAMPLES; a++) {
            count column = left[line][a], row = top[line][a];
            count next = column + (column + 1 < w), below = row + (row + 1 < h);
            float share = across[line][a];
            float upper = gray[row][column] + share * (gray[row][next] - gray[row][column]);
            float lower = gray[below][column] + share * (gray[below][next] - gray[below][column]);
            profile[a] += (upper + down[line][a] * (lower - upper)) / LINES;
        }
}

/* The step on each profile, with filters for its group, fitted about the offset that explains
   most. */
void fit_steps(count h, count w, rows k, count m, count g, count f, const float gray[h][w],
               const double points[k][m][2], const double normals[k][m][2],
               const int16_t polarity[k][m], const double spacing[k][m],
               const double curvature[k][m], const double blur[k], const int32_t groups[k][m],
               const double half_widths[g], const int32_t filters[g], const double along[13],
               const float search[f][13][51], const float parts[f][17][13][18],
               const double known[f][3][17], double maximum_aside, double minimum_step,
               double offset[k][m], double dark[k][m], double bright[k][m], double slope[k][m],
               double sensitivity[k][m], double softness[k][m], double residual[k][m],
               bool visible[k][m])
{
    for (count i = 0; i < k; i++)
        for (count j = 0; j < m; j++) {
            count group = within(groups[i][j], g);
            double half = half_widths[group];
            count filter = filters[group];
            visible[i][j] = half > 0 && filter >= 0 && filter < f;
            if (!visible[i][j]) {
                offset[i][j] = dark[i][j] = bright[i][j] = slope[i][j] = 0;
                sensitivity[i][j] = softness[i][j] = residual[i][j] = 0;
                continue;
            }
            double outwards = polarity[i][j]; /* from dark to bright, or the other way */
            double way[2] = {outwards * normals[i][j][0], outwards * normals[i][j][1]};
            double aside = lesser(spacing[i][j] / 4, maximum_aside);
            float profile[SAMPLES], found[3 * OFFSETS] = {0}, fitted[PARTS + SAMPLES] = {0};
            sample_profile(h, w, gray, points[i][j], way, aside, half, along, profile);
            for (int a = 0; a < SAMPLES; a++)
                for (int b = 0; b < 3 * OFFSETS; b++)
                    found[b] += profile[a] * search[filter][a][b];
            int best = 0;
            float most = -1;
            for (int b = 0; b < OFFSETS; b++) {
                float first = found[b], second = found[OFFSETS + b];
                float contrast = found[2 * OFFSETS + b];
                float explained = first * first + second * second;
                if (contrast > 0 && explained > most) {
                    most = explained;
                    best = b;
                }
            }
            for (int a = 0; a < SAMPLES; a++)
                for (int part = 0; part < PARTS + SAMPLES; part++)
                    fitted[part] += profile[a] * parts[filter][best][a][part];
            double low = fitted[0], high = fitted[1], squares = 0;
            for (int part = PARTS; part < PARTS + SAMPLES; part++)
                squares += fitted[part] * fitted[part];
            double contrast = greater(high - low, minimum_step);
            double reach = known[filter][1][best];
            double moved = lesser(greater(-fitted[2] / contrast, -reach), reach);
            /* On a curve, the blur and the chord between the two lines lie inside. */
            double inside = (blur[i] * blur[i] + aside * aside) / 2 * curvature[i][j];
            offset[i][j] = outwards * (known[filter][0][best] + moved) + inside;
            dark[i][j] = low;
            bright[i][j] = high;
            slope[i][j] = outwards * (fitted[3] / greater(high, minimum_step));
            sensitivity[i][j] = known[filter][2][best];
            softness[i][j] = -fitted[4] / contrast;
            residual[i][j] = sqrt(squares / SAMPLES);
        }
}
