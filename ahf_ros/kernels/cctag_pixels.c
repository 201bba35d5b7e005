/* The pixels about a CCTag, as print, light and lens form them, and what forms them, fitted.

   Sharp light times the sharp print, at two points a px, is blurred, so that light and ink mix as
   in a lens. A camera's gamma, and its unsharp mask, follow. */

#include <math.h>

#include "cctag.h"
#include "kernels.h"
#include "robust.h"

/* Where parameters are: seven of the frame are first, and the values of `struct formed`. */
enum { SHIFT = 7, BLUR, CONTRAST, SLOPES, EDGES = 12, MOST = 27 };
/* What is blurred: what is seen, its changes by the print, by the blur, and by edges of light. */
enum { SEEN, OF_FRAME, OF_SHIFT = 8, OF_CONTRAST, OF_BLUR, OF_LIGHT, IMAGES = 20 };
/* Rows of fine points, besides these. */
enum { AWAY = IMAGES, LIGHT_AWAY, X, Y, LIGHT_X, LIGHT_Y, LIGHT, INK, RADIUS, SCALE, BY_RADIUS, BY_SHIFT, ROWS };
enum { MARGIN = 3, TAPS = 20, MASK_TAPS = 5 };
#define SHARP 0.20412414523193150818 /* blur of what is sharp, px: a triangle over two points */
#define BEYOND 3.5 /* deviations, beyond which blur mixes nothing */
#define DARK 1e-4f /* light, of that on paper, that is black */
#define SQRT_2_PI 2.50662827463100050242

struct camera {
    double light[3][3]; /* frame of the light */
    double size;        /* its radius, px */
    double gamma, sharpening, mask;
};

struct formed {
    double frame[3][3];
    double values[MOST - SHIFT]; /* shift, ln blur, contrast, slopes, and edges of light */
};

struct plane { /* px to a frame's plane, about its centre */
    double matrix[3][3], x, y;
};

struct weights {
    count taps;
    float weights[TAPS + 1], squares[TAPS + 1]; /* the latter of deviations */
    double change;                              /* of ln of their width, by ln of the blur */
};

static struct plane plane_of(const double frame[3][3])
{
    struct plane it = {.x = frame[0][2], .y = frame[1][2]};
    inverted(frame, it.matrix);
    double scale = it.matrix[2][0] * it.x + it.matrix[2][1] * it.y + it.matrix[2][2];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            it.matrix[i][j] /= scale;
    return it;
}

static struct weights weights_of(double ln_blur)
{
    double square = exponential(2 * ln_blur);
    double rest = sqrt(greater(square - SHARP * SHARP, 0.01));
    struct weights it = {.taps = (count)held(2 * BEYOND * rest + 1, 1, TAPS),
                         .change = square / (rest * rest)};
    for (count t = 0; t <= it.taps; t++) {
        double away = t / (2 * rest);
        it.weights[t] = (float)exponential(-0.5 * away * away);
        it.squares[t] = (float)(away * away);
    }
    return it;
}

/* One over the sum of weights of each pixel of a line, and their mean of squares of deviations. */
static void sums_of_weights(count w, const struct weights *by, float over[w], float means[w])
{
    for (count j = 0; j < w; j++) {
        float sum = 0, squares = 0;
        for (count t = -by->taps; t <= by->taps; t++)
            if (2 * j + t >= 0 && 2 * j + t < 2 * w) {
                count size = t < 0 ? -t : t;
                sum += by->weights[size];
                squares += by->weights[size] * by->squares[size];
            }
        over[j] = 1 / sum;
        means[j] = squares / sum;
    }
}

static void in_plane(count n, const struct plane *it, double row, const float away[n], float x[n],
                     float y[n])
{
    float down = (float)(row - it->y), m[3][3];
    for (int i = 0; i < 3; i++) {
        m[i][0] = (float)it->matrix[i][0];
        m[i][1] = (float)it->matrix[i][1] * down;
    }
    for (count q = 0; q < n; q++) {
        float scale = m[2][0] * away[q] + m[2][1] + 1;
        x[q] = (m[0][0] * away[q] + m[0][1]) / scale;
        y[q] = (m[1][0] * away[q] + m[1][1]) / scale;
    }
}

/* Light on a row of fine points, and its changes at each edge, in shares of it: density, change
   by the height and by the width. */
static void light_on(count n, const struct camera *camera, const struct formed *by, count edges,
                     float rows[ROWS][n])
{
    const float *x = rows[LIGHT_X], *y = rows[LIGHT_Y];
    float *light = rows[LIGHT];
    float by_x = (float)by->values[SLOPES - SHIFT], by_y = (float)by->values[SLOPES + 1 - SHIFT];
    for (count q = 0; q < n; q++)
        light[q] = exponential_f(by_x * x[q] + by_y * y[q]);
    for (count e = 0; e < edges; e++) {
        const double *edge = by->values + EDGES - SHIFT + OF_EDGE * e;
        double cosine, sine, grown = exponential(edge[3]);
        cosine_and_sine(edge[0], &cosine, &sine);
        double width = greater(exponential(edge[4]), SHARP / camera->size);
        float c = (float)cosine, s = (float)sine, offset = (float)edge[1];
        float half = (float)(edge[2] / 2), more = (float)(grown - 1), wide = (float)width;
        float narrow = (float)(1 / width), steep = (float)((grown - 1) / (width * SQRT_2_PI));
        float *density = rows[OF_LIGHT + 3 * e], *height = rows[OF_LIGHT + 3 * e + 1];
        float *away = rows[OF_LIGHT + 3 * e + 2];
        for (count q = 0; q < n; q++) {
            float across = c * x[q] + s * y[q] - offset, along = c * y[q] - s * x[q];
            away[q] = (across - half * (across * across + along * along)) * narrow;
        }
        for (count q = 0; q < n; q++) {
            float power = bell_f(away[q]);
            float share = normal_share_f(away[q], power), own = 1 + more * share;
            light[q] *= own;
            density[q] = power / own * steep;
            height[q] = (float)grown * share / own;
            away[q] *= density[q] * -wide;
        }
    }
}

/* Ink on a row of fine points, and its changes by the radius, over the radius, and by the shift.

   Edges are those of a triangular blur as wide as two fine points are apart. */
static void ink_on(count n, count c, const double circles[c], const struct formed *by,
                   float rows[ROWS][n])
{
    const double(*f)[3] = by->frame;
    double a[2][2], g[2][2];
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
            a[i][j] = f[i][j] - f[i][2] * f[2][j];
    double square = squared(a[0][0] * a[1][1] - a[0][1] * a[1][0]);
    /* The square of how the radius grows by pixels, times itself: hardly changed by perspective. */
    g[0][0] = (a[1][1] * a[1][1] + a[0][1] * a[0][1]) / square;
    g[0][1] = -(a[1][1] * a[1][0] + a[0][1] * a[0][0]) / square;
    g[1][1] = (a[1][0] * a[1][0] + a[0][0] * a[0][0]) / square;
    float xx = (float)g[0][0], xy = (float)(2 * g[0][1]), yy = (float)g[1][1];
    const float *x = rows[X], *y = rows[Y];
    float *radius = rows[RADIUS], *scale = rows[SCALE], *ink = rows[INK];
    float *by_radius = rows[BY_RADIUS], *by_shift = rows[BY_SHIFT];
    for (count q = 0; q < n; q++) {
        radius[q] = sqrtf(x[q] * x[q] + y[q] * y[q]) + 1e-6f;
        float growth = sqrtf((xx * x[q] + xy * y[q]) * x[q] + yy * y[q] * y[q] + 1e-12f);
        scale[q] = radius[q] / growth * 2;
    }
    for (count q = 0; q < n; q++)
        ink[q] = by_radius[q] = by_shift[q] = 0;
    for (count i = 0; i < c; i++) {
        float sign = circles[i] < 0 ? -1 : circles[i] > 0, own = (float)fabs(circles[i]);
        float grown = sign * (float)(by->values[0] * 2);
        for (count q = 0; q < n; q++) {
            float away = held_f((own - radius[q]) * scale[q] + grown, -1, 1);
            float density = 1 - fabsf(away);
            ink[q] += sign * 0.5f * away * (1 + density);
            by_radius[q] += sign * density;
            by_shift[q] += 2 * density;
        }
    }
    for (count q = 0; q < n; q++)
        by_radius[q] *= scale[q] / radius[q];
}

/* What is blurred, on a row of fine points. */
static void sharp_on(count n, count edges, double contrast, bool changes, float rows[ROWS][n])
{
    float of_ink = (float)contrast;
    const float *light = rows[LIGHT], *ink = rows[INK], *x = rows[X], *y = rows[Y];
    const float *outwards = rows[OF_FRAME + 2];
    float *across = rows[OF_FRAME], *down = rows[OF_FRAME + 1];
    for (count q = 0; q < n; q++)
        rows[SEEN][q] = light[q] * (1 + of_ink * ink[q]);
    if (!changes)
        return;
    for (count q = 0; q < n; q++)
        rows[OF_CONTRAST][q] = light[q] * ink[q];
    for (count q = 0; q < n; q++)
        rows[OF_SHIFT][q] = light[q] * of_ink * rows[BY_SHIFT][q];
    for (count q = 0; q < n; q++) {
        float by_radius = light[q] * of_ink * rows[BY_RADIUS][q];
        across[q] = by_radius * x[q];
        down[q] = by_radius * y[q];
    }
    for (count q = 0; q < n; q++)
        rows[OF_FRAME + 2][q] = across[q] * x[q] + down[q] * y[q];
    for (count q = 0; q < n; q++)
        rows[OF_FRAME + 3][q] = across[q] * x[q] - down[q] * y[q];
    for (count q = 0; q < n; q++)
        rows[OF_FRAME + 4][q] = 2 * across[q] * y[q];
    for (count q = 0; q < n; q++)
        rows[OF_FRAME + 5][q] = -x[q] * outwards[q];
    for (count q = 0; q < n; q++)
        rows[OF_FRAME + 6][q] = -y[q] * outwards[q];
    for (count p = OF_LIGHT; p < OF_LIGHT + 3 * edges; p++)
        for (count q = 0; q < n; q++)
            rows[p][q] *= rows[SEEN][q];
}

/* Add to a line of pixels what of a row of fine points, first even and then odd ones, is so many
   points away. */
static void mix(count w, count t, float weight, const float fine[2][w], float line[w])
{
    count phase = t & 1, shift = (t - phase) / 2;
    count low = shift < 0 ? -shift : 0, high = shift > 0 ? w - shift : w;
    for (count j = low; j < high; j++)
        line[j] += weight * fine[phase][j + shift];
}

/* A camera's gamma, and its unsharp mask. */
static void take(count h, count w, count images, const struct camera *camera,
                 float over[w],
                 float mixed[h][IMAGES][w], float scratch[h][IMAGES][w])
{
    for (count i = MARGIN; i < h - MARGIN && camera->gamma != 1; i++) {
        float power = (float)(1 / camera->gamma);
        for (count j = MARGIN; j < w - MARGIN; j++) {
            float first = greater_f(mixed[i][SEEN][j], DARK);
            mixed[i][SEEN][j] = exponential_f(logarithm_f(first) * power);
            over[j] = mixed[i][SEEN][j] / first * power;
        }
        for (count p = 1; p < images; p++)
            for (count j = MARGIN; j < w - MARGIN; j++)
                mixed[i][p][j] *= over[j];
    }
    if (camera->sharpening == 0)
        return;
    float weights[MASK_TAPS + 1], more = (float)camera->sharpening;
    for (count t = 0; t <= MASK_TAPS; t++)
        weights[t] = (float)exponential(-0.5 * squared(t / camera->mask));
    for (count j = 0; j < w; j++)
        over[j] = 0;
    for (count t = -MASK_TAPS; t <= MASK_TAPS; t++)
        for (count j = MARGIN; j < w - MARGIN; j++)
            if (j + t >= MARGIN && j + t < w - MARGIN)
                over[j] += weights[t < 0 ? -t : t];
    for (count i = MARGIN; i < h - MARGIN; i++)
        for (count p = 0; p < images; p++) {
            for (count j = MARGIN; j < w - MARGIN; j++)
                scratch[i][p][j] = 0;
            for (count t = -MASK_TAPS; t <= MASK_TAPS; t++) {
                count low = MARGIN - (t < 0 ? t : 0), high = w - MARGIN - (t > 0 ? t : 0);
                float weight = weights[t < 0 ? -t : t];
                for (count j = low; j < high; j++)
                    scratch[i][p][j] += weight * mixed[i][p][j + t];
            }
            for (count j = MARGIN; j < w - MARGIN; j++)
                scratch[i][p][j] /= over[j];
        }
    for (count i = MARGIN; i < h - MARGIN; i++) {
        float sum = 0;
        for (count t = -MASK_TAPS; t <= MASK_TAPS; t++)
            if (i + t >= MARGIN && i + t < h - MARGIN)
                sum += weights[t < 0 ? -t : t];
        for (count p = 0; p < images; p++)
            for (count j = MARGIN; j < w - MARGIN; j++)
                mixed[i][p][j] *= 1 + more;
        for (count t = -MASK_TAPS; t <= MASK_TAPS; t++)
            if (i + t >= MARGIN && i + t < h - MARGIN) {
                float weight = more * weights[t < 0 ? -t : t] / sum;
                for (count p = 0; p < images; p++)
                    for (count j = MARGIN; j < w - MARGIN; j++)
                        mixed[i][p][j] -= weight * scratch[i + t][p][j];
            }
    }
}

/* Gray values that are formed, and their derivatives unless these are not asked for, `mixed`. */
static void form(count h, count w, count c, const double circles[c], const struct camera *camera,
                 const struct formed *by, count edges, bool changes, float rows[ROWS][2][w],
                 float lines[IMAGES][w], float of_h[2][h], float of_w[2][w], float mixed[h][IMAGES][w],
                 float scratch[h][IMAGES][w])
{
    struct plane target = plane_of(by->frame), light = plane_of(camera->light);
    struct weights blur = weights_of(by->values[BLUR - SHIFT]);
    count n = 2 * w, images = changes ? OF_LIGHT + 3 * edges : 1;
    float(*points)[n] = (float(*)[n])rows;
    sums_of_weights(h, &blur, of_h[0], of_h[1]);
    sums_of_weights(w, &blur, of_w[0], of_w[1]);
    for (count i = 0; i < h; i++)
        for (count p = 0; p < images; p++)
            for (count j = 0; j < w; j++)
                mixed[i][p][j] = 0;
    for (count phase = 0; phase < 2; phase++)
        for (count j = 0; j < w; j++) {
            rows[AWAY][phase][j] = (float)(j + 0.5 * phase - target.x);
            rows[LIGHT_AWAY][phase][j] = (float)(j + 0.5 * phase - light.x);
        }
    for (count r = 0; r < 2 * h; r++) {
        in_plane(n, &target, 0.5 * r, points[AWAY], points[X], points[Y]);
        in_plane(n, &light, 0.5 * r, points[LIGHT_AWAY], points[LIGHT_X], points[LIGHT_Y]);
        light_on(n, camera, by, edges, points);
        ink_on(n, c, circles, by, points);
        sharp_on(n, edges, by->values[CONTRAST - SHIFT], changes, points);
        for (count p = 0; p < images; p++) {
            count from = p == OF_BLUR ? SEEN : p;
            for (count j = 0; j < w; j++)
                lines[p][j] = 0;
            for (count t = -blur.taps; t <= blur.taps; t++) {
                count size = t < 0 ? -t : t;
                float weight = blur.weights[size] * (p == OF_BLUR ? blur.squares[size] : 1);
                mix(w, t, weight, (const float(*)[w])rows[from], lines[p]);
            }
            for (count j = 0; j < w; j++)
                lines[p][j] *= of_w[0][j];
        }
        if (changes)
            for (count j = 0; j < w; j++)
                lines[OF_BLUR][j] -= of_w[1][j] * lines[SEEN][j];
        count low = (r - blur.taps + 1) / 2, high = (r + blur.taps) / 2;
        for (count i = low < 0 ? 0 : low; i <= high && i < h; i++) {
            count size = r < 2 * i ? 2 * i - r : r - 2 * i;
            float weight = blur.weights[size] * of_h[0][i];
            float change = weight * (blur.squares[size] - of_h[1][i]);
            for (count p = 0; p < images; p++)
                for (count j = 0; j < w; j++)
                    mixed[i][p][j] += weight * lines[p][j];
            if (changes)
                for (count j = 0; j < w; j++)
                    mixed[i][OF_BLUR][j] += change * lines[SEEN][j];
        }
    }
    if (changes)
        for (count i = 0; i < h; i++)
            for (count j = 0; j < w; j++)
                mixed[i][OF_BLUR][j] *= (float)blur.change;
    take(h, w, images, camera, of_w[0], mixed, scratch);
}

/* Gray values of known pixels, and their derivatives by all parameters.

   What edges of light change at places far from them is multiplied after blur, not before. */
static void gather(count h, count w, count n, const bool known[h][w], const struct camera *camera,
                   const struct formed *by, count edges, bool changes,
                   float mixed[h][IMAGES][w], double shown[n], float derivatives[n][MOST])
{
    struct plane light = plane_of(camera->light);
    count k = 0;
    for (count i = MARGIN; i < h - MARGIN; i++)
        for (count j = MARGIN; j < w - MARGIN && k < n; j++) {
            if (!known[i][j])
                continue;
            shown[k] = mixed[i][SEEN][j];
            float *by_all = derivatives[k++];
            if (!changes)
                continue;
            for (int p = 0; p < SHIFT; p++)
                by_all[p] = mixed[i][OF_FRAME + p][j];
            by_all[SHIFT] = mixed[i][OF_SHIFT][j];
            by_all[BLUR] = mixed[i][OF_BLUR][j];
            by_all[CONTRAST] = mixed[i][OF_CONTRAST][j];
            float away = (float)(j - light.x), x, y;
            in_plane(1, &light, (double)i, &away, &x, &y);
            float first = mixed[i][SEEN][j] / (float)camera->gamma;
            by_all[SLOPES] = first * x;
            by_all[SLOPES + 1] = first * y;
            for (count e = 0; e < edges; e++) {
                const double *edge = by->values + EDGES - SHIFT + OF_EDGE * e;
                float *by_edge = by_all + EDGES + OF_EDGE * e;
                double cosine, sine;
                cosine_and_sine(edge[0], &cosine, &sine);
                double across = cosine * x + sine * y - edge[1], along = cosine * y - sine * x;
                float density = mixed[i][OF_LIGHT + 3 * e][j];
                by_edge[0] = density * (float)(along * (1 + edge[2] * edge[1]));
                by_edge[1] = density * (float)(edge[2] * across - 1);
                by_edge[2] = density * (float)((across * across + along * along) / -2);
                by_edge[3] = mixed[i][OF_LIGHT + 3 * e + 1][j];
                by_edge[4] = mixed[i][OF_LIGHT + 3 * e + 2][j];
            }
        }
}

static count begin(count q, const double frame[3][3], const double values[q],
                   const double light[3][3], double light_size, double gamma, double sharpening,
                   double mask, struct formed *by, struct camera *camera)
{
    *camera = (struct camera){
        .size = light_size, .gamma = gamma, .sharpening = sharpening, .mask = mask};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            by->frame[i][j] = frame[i][j];
            camera->light[i][j] = light[i][j];
        }
    count edges = (q - (EDGES - SHIFT)) / OF_EDGE;
    edges = edges < 0 ? 0 : edges > MOST_EDGES ? MOST_EDGES : edges;
    for (count i = 0; i < MOST - SHIFT; i++)
        by->values[i] = i < q ? values[i] : 0;
    return edges;
}

void cctag_pixels(count h, count w, count n, count c, count q, const bool known[h][w],
                  const double circles[c], const double light[3][3], double light_size,
                  double gamma, double sharpening, double mask, const double frame[3][3],
                  const double values[q], double shown[n], float derivatives[n][27],
                  float rows[32][2][w], float lines[20][w], float of_h[2][h], float of_w[2][w],
                  float mixed[h][20][w], float scratch[h][20][w])
{
    struct formed by;
    struct camera camera;
    count edges = begin(q, frame, values, light, light_size, gamma, sharpening, mask, &by, &camera);
    for (count k = 0; k < n; k++) {
        shown[k] = 0;
        for (int p = 0; p < MOST; p++)
            derivatives[k][p] = 0;
    }
    form(h, w, c, circles, &camera, &by, edges, true, rows, lines, of_h, of_w, mixed, scratch);
    gather(h, w, n, known, &camera, &by, edges, true, mixed, shown, derivatives);
}

static double variance(const double noise[2], double gray)
{
    return noise[0] + noise[1] * greater(gray, 0);
}

/* The gray value of paper in full light. */
static double paper_of(count n, const double weights[n], const double plain[n],
                       const float seen[n])
{
    double both = 0, square = 0;
    for (count k = 0; k < n; k++) {
        both += weights[k] * plain[k] * seen[k];
        square += weights[k] * plain[k] * plain[k];
    }
    return both / greater(square, 1e-9);
}

static double rest_of(count n, const double weights[n], const double plain[n],
                      const float seen[n])
{
    double paper = paper_of(n, weights, plain, seen), sum = 0;
    for (count k = 0; k < n; k++)
        sum += weights[k] * squared(seen[k] - paper * plain[k]);
    return sum;
}

/* Normal equations of what is known of all parameters before they are fitted. */
static void add_known(count p, const struct formed *by, double size, double between,
                      const double usual[5], const double deviations[5], const double near[5],
                      const double perspective[2][2], double hardly, double normal[p + 1][p + 1],
                      double right[p + 1])
{
    const double *values = by->values;
    double blur = logarithm(exponential(2 * values[BLUR - SHIFT]) + between) / 2;
    const double of_print[3] = {values[0], blur, values[CONTRAST - SHIFT]};
    for (int a = 0; a < SHIFT; a++)
        normal[a][a] += hardly;
    for (int a = SLOPES; a < EDGES; a++)
        normal[a][a] += hardly;
    for (int a = 0; a < 2; a++)
        for (int b = 0; b < 2; b++) {
            normal[SHIFT - 2 + a][SHIFT - 2 + b] += perspective[a][b];
            right[SHIFT - 2 + a] -= perspective[a][b] * by->frame[2][b];
        }
    for (int a = 0; a < 3; a++) {
        double weight = 1 / squared(deviations[a]);
        normal[SHIFT + a][SHIFT + a] += weight;
        right[SHIFT + a] += (usual[a] - of_print[a]) * weight;
    }
    for (count first = EDGES; first < p; first += OF_EDGE) {
        const double *edge = values + first - SHIFT;
        double towards = (edge[3] < 0 ? -1 : 1) / size;
        double bend = squared(towards / deviations[3]), width = 1 / squared(deviations[4]);
        for (int a = 0; a < OF_EDGE; a++)
            normal[first + a][first + a] += 1 / squared(near[a]);
        normal[first + 2][first + 2] += bend;
        right[first + 2] += (usual[3] / towards - edge[2]) * bend;
        normal[first + 4][first + 4] += width;
        right[first + 4] += (usual[4] - edge[4] - logarithm(size)) * width;
    }
}

/* What is taken from ln of the odds: half the squares of all errors, and of what is unlike other
   prints. The gray values that are formed are `shown`. */
static double cost_of(count n, const struct formed *by, const double weights[n],
                      const double plain[n], const float seen[n], const double noise[2],
                      double between, const double usual[5], const double deviations[5],
                      double different, double most_squared, double shown[n])
{
    double paper = paper_of(n, weights, plain, seen), sum = 0;
    for (count k = 0; k < n; k++) {
        shown[k] = paper * plain[k];
        sum += lesser(squared(seen[k] - shown[k]) / variance(noise, shown[k]), most_squared);
    }
    double blur = logarithm(exponential(2 * by->values[BLUR - SHIFT]) + between) / 2;
    const double of_print[3] = {by->values[0], blur, by->values[CONTRAST - SHIFT]};
    for (int a = 0; a < 3; a++)
        sum += squared((usual[a] - of_print[a]) / (different * deviations[a]));
    return sum / 2;
}

void cctag_fit(count h, count w, count n, count c, count q, count rounds,
               const float seen[n], const bool known[h][w], const double circles[c], const double light[3][3],
               double light_size, double gamma, double sharpening, double mask,
               const double start[3][3], const double values[q], const double low[q],
               const double high[q], double most_of_frame, double most_change, double between,
               const double usual[5], const double deviations[5], const double near[5],
               const double perspective[2][2], double hardly, const double noise[2],
               const double outliers[rounds], double normal_spread, double least_spread,
               double least_free, int16_t trials, double first_damping, double least_damping,
               double staying, double by_place, double changing, double changing_light,
               double different, double most_squared, double most_cost, double frame[3][3],
               double fitted[q], double shown[n], double covariance[27][27], double cost[1],
               double plain[3][n], double weights[n], double sizes[n], float derivatives[n][27],
               float rows[32][2][w], float lines[20][w], float of_h[2][h], float of_w[2][w],
               float mixed[h][20][w], float scratch[h][20][w])
{
    struct formed by;
    struct camera camera;
    count edges = begin(q, start, values, light, light_size, gamma, sharpening, mask, &by, &camera);
    count p = EDGES + OF_EDGE * edges, size = p + 1;
    double normal[size][size], damped[size][size], right[size], change[size];
    double *now = plain[0], *tried = plain[1], damping = first_damping;
    for (count k = 0; k < n; k++) {
        now[k] = tried[k] = 0;
        weights[k] = 1 / variance(noise, seen[k]);
    }
    bool again = true;
    for (count round = 0; round < rounds; round++) {
        if (again) {
            form(h, w, c, circles, &camera, &by, edges, true, rows, lines, of_h, of_w, mixed,
                 scratch);
            gather(h, w, n, known, &camera, &by, edges, true, mixed, now, derivatives);
        }
        double paper = paper_of(n, weights, now, seen);
        for (count k = 0; k < n; k++) {
            double size_of = fabs(seen[k] - paper * now[k]) / sqrt(variance(noise, paper * now[k]));
            sizes[k] = plain[2][k] = size_of > 0 ? size_of : 0;
        }
        double middle = (ranked(n, sizes, n / 2) + ranked(n, sizes, (n - 1) / 2)) / 2;
        double spread = outliers[round] * greater(normal_spread * middle, least_spread);
        double free = -(double)p, best = 0;
        for (int a = 0; a < size; a++) {
            right[a] = 0;
            for (int b = 0; b < size; b++)
                normal[a][b] = 0;
        }
        for (count k = 0; k < n; k++) {
            double row[MOST + 1], error = seen[k] - paper * now[k];
            double gain = geman_mcclure(plain[2][k] / spread);
            weights[k] = gain / variance(noise, paper * now[k]);
            free += gain;
            best += weights[k] * error * error;
            for (int a = 0; a < p; a++)
                row[a] = paper * derivatives[k][a];
            row[p] = now[k];
            add_products(size, normal, right, row, weights[k], error);
        }
        double each = greater(free, least_free) / greater(best, 1e-9);
        for (int a = 0; a < size; a++) {
            right[a] *= each;
            for (int b = a; b < size; b++)
                normal[a][b] *= each;
        }
        mirror(size, normal);
        add_known(p, &by, light_size, between, usual, deviations, near, perspective, hardly, normal,
                  right);
        struct formed before = by;
        bool better = false;
        for (int trial = 0; trial < trials && !better; trial++) {
            for (int a = 0; a < size; a++) {
                change[a] = right[a];
                for (int b = 0; b < size; b++)
                    damped[a][b] = normal[a][b] * (a == b ? 1 + damping : 1);
            }
            solve(size, 1, damped, (double(*)[1])change);
            by = before;
            double of_frame[SHIFT];
            for (int a = 0; a < SHIFT; a++)
                of_frame[a] = held(change[a], -most_of_frame, most_of_frame);
            move_frame(by.frame, of_frame);
            for (int a = 0; a < p - SHIFT; a++) {
                double moved = by.values[a] + held(change[SHIFT + a], -most_change, most_change);
                by.values[a] = held(moved, low[a], high[a]);
            }
            form(h, w, c, circles, &camera, &by, edges, false, rows, lines, of_h, of_w, mixed,
                 scratch);
            gather(h, w, n, known, &camera, &by, edges, false, mixed, tried, derivatives);
            better = rest_of(n, weights, tried, seen) <= best * (1 + least_damping);
            damping = better ? greater(damping / 5, least_damping)
                             : greater(10 * damping, first_damping);
        }
        if (!better) {
            by = before;
            break;
        }
        double *swapped = now;
        now = tried;
        tried = swapped;
        double moved = sqrt(squared(by.frame[0][2] - before.frame[0][2]) +
                            squared(by.frame[1][2] - before.frame[1][2]));
        moved = greater(moved, greater(fabs(change[SHIFT]), fabs(change[BLUR])) / by_place);
        if (moved < staying)
            break;
        if (cost_of(n, &by, weights, now, seen, noise, between, usual, deviations, different,
                    most_squared, shown) > (round ? most_cost : 2 * most_cost))
            break;
        /* The derivatives hardly change where the place does not. */
        again = moved > changing;
        for (count a = EDGES; a < p; a++)
            again |= fabs(change[a]) > changing_light;
    }
    cost[0] = cost_of(n, &by, weights, now, seen, noise, between, usual, deviations, different,
                      most_squared, shown);
    for (int a = 0; a < size; a++)
        for (int b = 0; b < size; b++)
            damped[a][b] = a == b;
    solve(size, size, normal, damped);
    for (int a = 0; a < MOST; a++)
        for (int b = 0; b < MOST; b++)
            covariance[a][b] = a < p && b < p ? damped[a][b] : 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            frame[i][j] = by.frame[i][j];
    for (count i = 0; i < q; i++)
        fitted[i] = i < MOST - SHIFT ? by.values[i] : 0;
}
