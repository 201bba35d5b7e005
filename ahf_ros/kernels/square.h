/* What evidence of square markers has in common, of levels and of steps. */

#ifndef AHF_SQUARE_H
#define AHF_SQUARE_H

#include "elementary.h"
#include "images.h"
#include "kernels.h"

/* Logarithmic odds of a marker whose cells are ink, of square corners, and of the border. */
enum { INK, SQUARE, AROUND };

static inline double sampled(count h, count w, const uint8_t gray[h][w],
                             const double frame[3][3], double x, double y)
{
    double scale = frame[2][0] * x + frame[2][1] * y + frame[2][2];
    return byte_at(h, w, gray, (frame[0][0] * x + frame[0][1] * y + frame[0][2]) / scale,
                   (frame[1][0] * x + frame[1][1] * y + frame[1][2]) / scale);
}

static inline double bounded(double odds, double most)
{
    return lesser(greater(odds, -most), most);
}

/* Take from values in rows what blur mixed into each row from the one before it and from the one
   behind it, by elimination. */
static inline void unmix(count n, double before, double behind, double values[n][n],
                         double scale[n])
{
    for (count row = 0; row < n; row++) {
        double from = row ? before : 0, own = 1 - from - (row < n - 1 ? behind : 0);
        scale[row] = row ? 1 / (own - from * behind * scale[row - 1]) : 1 / own;
        for (count column = 0; column < n; column++) {
            double mixed = row ? from * values[row - 1][column] : 0;
            values[row][column] = (values[row][column] - mixed) * scale[row];
        }
    }
    for (count row = n - 2; row >= 0; row--)
        for (count column = 0; column < n; column++)
            values[row][column] -= behind * scale[row] * values[row + 1][column];
}

static inline void transpose(count n, double values[n][n])
{
    for (count row = 0; row < n; row++)
        for (count column = 0; column < row; column++) {
            double swapped = values[row][column];
            values[row][column] = values[column][row];
            values[column][row] = swapped;
        }
}

static inline void set_logarithms(count n, double values[n], double offset)
{
    for (count i = 0; i < n; i++)
        values[i] = logarithm(greater(values[i], 0) + offset);
}

/* Logarithmic odds of a square corner: its outermost part is as bright as paper if it is round. */
static inline double corner_odds(double outermost, double half, double step, const double shown[2],
                          double sharpness)
{
    double dark = exponential(-step / 2), bright = exponential(step / 2);
    double level = (exponential(outermost - half) - dark) / (bright - dark);
    double blurred = 1 - shown[0] * shown[1];
    return sharpness * (1 - blurred) * ((1 + blurred) / 2 - level);
}

#endif
