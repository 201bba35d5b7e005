/* The kernels, as ahf_ros/kernels/__init__.py reads them to call them.

   A declaration says all of a kernel: a count is taken from the arrays whose shapes have its name;
   constant arrays, and numbers, are its arguments in their order; all other arrays are its
   results. The caller has checked that all shapes agree and that none is 0. Arrays are in C order,
   do not overlap, and may have any values: no value is an index that was not held within bounds. */

#ifndef AHF_KERNELS_H
#define AHF_KERNELS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef ptrdiff_t count;

/* elementary.c */

void exponentials(count n, const double x[n], double y[n]);
void logarithms(count n, const double x[n], double y[n]);
void hyperbolic_tangents(count n, const double x[n], double y[n]);
void normal_shares(count n, const double x[n], double y[n]);
void exponentials_f(count n, const float x[n], float y[n]);
void logarithms_f(count n, const float x[n], float y[n]);

/* band_edges.c */

void gray_at(count k, count i, count c, count m, count r, count g, const float gray[i][c][m],
             const int64_t row[k], double innermost, const double outermost[k],
             const double radii[k][r][g], float values[k][r][m]);
void ink_shares(count k, count r, count g, count m, const double radii[k][r][g],
                const double plate[k][m], const double dot[k], const double inner[k],
                const double outer[k], const double blur[k], float bare[k][r][m],
                float marked[k][r][m]);
void step_evidence(count k, count m, count n, const float ground[k][2][m],
                   const float band[k][2][m], const float bare_ground[k][2][m],
                   const float marked_ground[k][2][m], const float bare_band[k][2][m],
                   const float marked_band[k][2][m], const float counts[k][2][m],
                   const float shares[n], const float contrast[k], const bool dark[k],
                   const float noise[k], const float glare[k], const float lit[k], float offset,
                   float white, float flat, float flat_white, float mark, float tail, float share,
                   float any, float plain, float at_ends, float looks[k][2][n][m],
                   float typical[k][2][2][m]);
void covered_ground(count k, count m, const float ground[k][2][m], const float band[k][2][m],
                    const float lit[k][2][m], const bool marked[k][2][m],
                    const bool visible[k][2][m], const float shade[k], const float contrast[k],
                    const bool dark[k], float offset, float white, float light_edge,
                    float marked_share, bool covered[k][2][m]);

/* bands.c */

void bounded_readings(count k, count h, count n, count m, const float values[k][h][n][m],
                      const float most[k], float bounded[k][n][m]);
void best_near_shares(count k, count n, count m, const float looks[k][n][m],
                      const int64_t reach[k], float best[k][n][m]);
void sector_evidence(count k, count m, count p, count n, const float inked[k][m],
                     const double rising[k][2][p], const double falling[k][2][p], double ones[k][p][n],
                     double pairs[k][p][n]);
void likeliest_bits(count k, count n, const double ones[k][n], const double pairs[k][n],
                    bool bits[k][n], double highest[k], bool before[k][2][n][2]);
void word_steps(count k, count w, count p, count n, count m, const int64_t words[k][w],
                const int64_t phases[k][w], const float rising[k][2][p], const float falling[k][2][p],
                int64_t last, uint8_t steps[k][w][m]);
void covered_words(count k, count w, count n, count m, const float looks[k][n][m],
                   const uint8_t steps[k][w][m], const int64_t first[k],
                   const float on_paper[k][m], const float on_mark[k][m], float price,
                   const float cost[k], const float paper_price[k], float scores[k][w]);
void hidden_angles(count k, count n, count m, const float looks[k][n][m],
                   const uint8_t steps[k][m], const int64_t first[k], const float on_paper[k][m],
                   const float on_mark[k][m], float price, const float cost[k],
                   const float paper_price[k], bool hidden[k][m], float until[k][m][3]);
void free_arcs(count k, count n, count m, const float looks[k][n][m], const int64_t first[k],
               const float border[k], float price, const float cost[k], float scores[k],
               int64_t borders[k]);
void best_moves(count k, count n, count m, count v, const float looks[k][n][m],
                const uint8_t steps[k][m], const int64_t here[v][m], const int64_t before[v][m],
                int64_t best[k]);
void predicted_angles(count k, count m, const float best[k][m], const float further[k], float price,
                      bool predicted[k][m], float bounded[k][m]);

#endif
