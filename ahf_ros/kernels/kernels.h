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
/* A count of what is independent of each other: threads may share it, with scratch of their own. */
typedef count rows;

/* The nearest index of an array of n. */
static inline count within(int64_t i, count n) { return i < 0 ? 0 : i < n ? (count)i : n - 1; }

/* elementary.c */

void exponentials(count n, const double x[n], double y[n]);
void logarithms(count n, const double x[n], double y[n]);
void normal_shares(count n, const double x[n], double y[n]);
void exponentials_f(count n, const float x[n], float y[n]);
void logarithms_f(count n, const float x[n], float y[n]);

/* polar.c */

void circle_values(count h, count w, rows k, count r, count m, const float image[h][w],
                   const double frames[k][3][3], const double directions[2][m],
                   const double radii[k][r], const float lift[k], float values[k][r][m],
                   double reach[k][m]);
void short_values(count h, count w, rows k, count r, count m, const int16_t image[h][w],
                  const double frames[k][3][3], const double directions[2][m],
                  const double radii[k][r], double unit, double values[k][m][r], bool inside[k]);
void second_differences(count h, count w, rows k, count m, const float image[h][w],
                        const double frames[k][3][3], const double points[2][m], double medians[k],
                        double scratch[m]);
void ground_votes(rows k, count i, count c, count m, count s, const float gray[i][c][m],
                  const int64_t row[k], const float white[k][m], const double radii[k][c],
                  const double least[k], const int64_t beyond[s][m], int64_t votes[k][s],
                  int64_t outermost[k], int32_t sums[c][m]);

/* band_edges.c */

void gray_at(count k, count i, count c, count m, count r, const float gray[i][c][m],
             const int64_t row[k], double innermost, const double outermost[k],
             const double radii[k][r], float values[k][r][m]);
void edge_evidence(rows k, count i, count c, count m, count n, const float gray[i][c][m],
                   const int64_t row[k], const double reach[k][m], const double plate[k][m],
                   const double looks_of[k][9], const double edges[k][3], const float weight[k],
                   const float shares[n], const double deciding[24], float looks[k][2][n][m],
                   float typical[k][2][2][m], bool covered[k][2][m], float lit[k],
                   float read[2][7][m], float steps[7][m]);
void shifted_evidence(rows k, count i, count c, count m, count s, const float gray[i][c][m],
                      const int64_t row[k], const double reach[k][m], const double plate[k][m],
                      const double looks_of[k][9], const double edges[k][s][3],
                      const float weight[k], const double deciding[24], float looks[k][s][2][m],
                      float read[2][7][m], float steps[7][m], float of_edges[2][2][m]);

/* band_levels.c */

void level_evidence(rows k, count d, count m, count n, const float levels[k][d][m],
                    const float light[k][d][m], const float spread[k][d][m], const double radii[d],
                    const double band[2], const double edges[k][2], const double reach[k][m],
                    const double looks_of[k][9], const float weight[k], const float shares[n],
                    const double deciding[24], float looks[k][2][n][m], float dot[k], float lit[k],
                    bool covered[k][2][m], float read[d][7][m], float densities[d][n][m],
                    float rows[2][m], float odds[n][m], double scratch[d][m], bool places[6][d]);

/* appearance.c */

void unlike_shares(count k, count i, count c, count m, count n, const float gray[i][c][m],
                   const int64_t row[k], const double light[k][3], const double step[k],
                   const double radii[c], const bool clear[c], const double reach[k][m],
                   const double directions[2][m], const int64_t words[k], const int64_t phases[k],
                   const int64_t longer[2][k], const double kinds[k][4][2], double offset,
                   double even, double uneven, double inmost, double deeper, double unlike,
                   int64_t readings, double of_marks, double shares[k], float steps[c][m],
                   bool told[3][m], bool odd[2][m], int64_t counts[2][m], double most[n]);

/* bands.c */

void bounded_readings(rows k, count h, count n, count m, const float values[k][h][n][m],
                      const float most[k], const int64_t reach[k], float best[k][n][m],
                      float bounded[n][m]);
void sector_evidence(count k, count m, count p, count n, const float inked[k][m],
                     const double rising[k][2][p], const double falling[k][2][p], double ones[k][p][n],
                     double pairs[k][p][n]);
void likeliest_bits(count k, count n, const double ones[k][n], const double pairs[k][n],
                    bool bits[k][n], double highest[k], bool before[k][2][n][2]);
void competing_words(rows k, count n, count w, count c, const double ones[k][4][n],
                     const double pairs[k][4][n], const int64_t words[w], const float prior[w],
                     int64_t best[k][c], int64_t phases[k][c], float highest[c]);
void word_steps(rows k, count w, count p, count n, count m, const int64_t words[k][w],
                const int64_t phases[k][w], const float rising[k][2][p], const float falling[k][2][p],
                int64_t last, uint8_t steps[k][w][m]);
void covered_words(rows k, count w, count n, count m, const float looks[k][n][m],
                   const uint8_t steps[k][w][m], const int64_t first[k],
                   const float as_paper[2][k][m], float price, const float cost[k],
                   const float paper_price[k], const float most[k][m], float scores[k][w]);
void hidden_angles(count k, count n, count m, const float looks[k][n][m],
                   const uint8_t steps[k][m], const int64_t first[k],
                   const float as_paper[2][k][m], float price, const float cost[k],
                   const float paper_price[k], bool hidden[k][m], float until[k][m][3]);
void free_arcs(count k, count n, count m, const float looks[k][n][m], const int64_t first[k],
               const float border[k], float price, const float cost[k], float scores[k],
               int64_t borders[k]);
void best_moves(rows k, count n, count m, count v, const float looks[k][n][m],
                const uint8_t steps[k][m], const int64_t here[v][m], const int64_t before[v][m],
                int64_t best[k]);
void predicted_angles(count k, count m, const float best[k][m], const float further[k], float price,
                      bool predicted[k][m], float bounded[k][m]);

/* cctag_light.c */

/* ln of light at places, and what blur adds to it where ink changes as well, by its slope along the
   radius; `blur` is its variance, in steps of the radius and in radii. */
void cctag_light(count k, count m, count n, const float places[2][m][n],
                 const double heights[k][5], const double edges[k][3][5], const double width[k],
                 const double blur[k], const float slope[k][n], float plain[k][m][n],
                 float mixed[k][m][n]);

/* Edges of light that some settle at, or that are known if there are no rounds, and the heights of
   slopes, moves of frames and edges. */
void cctag_edges(rows k, count m, count n, const float values[k][m][n],
                 const float weight[k][m][n], const float slope[k][n], const double width[k],
                 const double area[k], const double start[k][3][5], int16_t number,
                 const float places[2][m][n], const float around[4][m][n], int16_t rounds,
                 double usual_moves, const double deviations[4], double least_variance,
                 double most_moved, double most_curved, double highest, double edges[k][3][5],
                 double heights[k][9], float rest[k][m][n], double variance[k],
                 float basis[21][m][n], float planes[5][m][n], float columns[3][n]);

/* cctag_pixels.c */

void cctag_pixels(count h, count w, count n, count c, count q, const bool known[h][w],
                  const double circles[c], const double light[3][3], double light_size,
                  double gamma, double sharpening, double mask, const double frame[3][3],
                  const double values[q], double shown[n], float derivatives[n][27],
                  float rows[32][2][w], float lines[20][w], float of_h[2][h], float of_w[2][w],
                  float mixed[h][20][w], float scratch[h][20][w]);
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
               float mixed[h][20][w], float scratch[h][20][w]);

/* robust.c */

void selected_medians(count k, count m, const double values[k][m], const bool selected[k][m],
                      double empty, double medians[k], double scratch[m]);
void linear_fits(rows k, count m, count n, const double values[k][m], const double weights[k][m],
                 const double basis[m][n], const double prior[n], double scale, int16_t rounds,
                 double unknowns[k][n], double residuals[k][m], double robust[m],
                 double normal[n][n], double products[m][n][n]);

/* profiles.c */

void edge_points(rows k, count m, const double frames[k][3][3], const double points[m][2],
                 const double normals[m][2], const double curvature[m], const double spacing[m],
                 double no_length, double images[k][m][2], double outwards[k][m][2],
                 double scale[k][m], double distance[k][m], double bend[k][m]);
void profile_groups(count k, count m, count w, const double points[k][m][2],
                    const double normals[k][m][2], const int16_t polarity[k][m],
                    const double scale[k][m], const double reach[k], const double enough[k],
                    const int32_t blurs[k], const double half_widths[w], double right,
                    double bottom, int32_t groups[k][m]);
void fit_steps(count h, count w, rows k, count m, count g, count f, const float gray[h][w],
               const double points[k][m][2], const double normals[k][m][2],
               const int16_t polarity[k][m], const double spacing[k][m],
               const double curvature[k][m], const double blur[k], const int32_t groups[k][m],
               const double half_widths[g], const int32_t filters[g], const double along[13],
               const float search[f][13][51], const float parts[f][17][13][18],
               const double known[f][3][17], double maximum_aside, double minimum_step,
               double offset[k][m], double dark[k][m], double bright[k][m], double slope[k][m],
               double sensitivity[k][m], double softness[k][m], double residual[k][m],
               bool visible[k][m]);

/* edge_fit.c */

void edge_weights(rows k, count m, const double dark[k][m], const double bright[k][m],
                  const double residual[k][m], const bool visible[k][m], double log_offset,
                  double normal, double minimum_contrast, double ratio_doubt,
                  double minimum_ratio_error, double residual_doubt, double minimum_residual,
                  double minimum_bright, bool seen[k][m], double weights[k][m],
                  double contrast[k], double scratch[2][m]);
void light_slopes(rows k, count l, count n, const double slopes[k][l][n],
                  const int16_t polarity[k][l][n], const double weights[k][l][n],
                  const float window[n][n], const double prior[k], double sharpened,
                  double minimum_usual, double outlier, int16_t rounds, double no_weight,
                  double errors[k][l][n], double smooth[k][l][n], double used[k][l][n],
                  double totals[k][l][n], float sums[2][n], bool seen[n], double scratch[2][n],
                  int32_t spans[n][2]);
void outline_fits(rows k, count m, count n, count q, const double offset[k][m],
                  const double sensitivity[k][m], const double slope[k][m],
                  const double dark[k][m], const double bright[k][m], const double scale[k][m],
                  const int16_t polarity[k][m], const bool seen[k][m], const double own[k][m],
                  const double basis[m][n], const double prior[q], double noise, double uneven,
                  double minimum_step, double normal, double outlier, double minimum,
                  bool in_px, int16_t rounds, double unknowns[k][q], double equations[k][q][q],
                  double errors[k][m], double relative[k][m], double weights[k][m],
                  double robust[k][m], double products[m][n][n], double scratch[6][m]);

/* edge_errors.c */

void edge_parts(rows k, count m, count n, count q, const double basis[m][n],
                const int16_t polarity[k][m], const double scale[k][m],
                const double sensitivity[k][m], const double equations[k][q][q],
                const double own[k][m], const double relative[k][m], const double weights[k][m],
                const double robust[k][m], const double errors[k][m],
                const double light_errors[k][m], const double light_weights[k][m],
                const double light_totals[k][m], const float window[m][m], double minimum_gain,
                double no_weight, double parts[k][2][m], double used[k][m], double inverse[q][2],
                float slopes[m]);
void errors_in_common(count k, count m, const double errors[k][m], const double outline[m],
                      int16_t disturbed, double no_error, double growth[k]);
void edge_covariances(count k, count m, const double parts[k][2][m], const double weights[k][m],
                      const double spacing[k][m], double unknowns, const double common[k],
                      double correlation, double sharing, double no_weight,
                      double covariance[k][2][2]);

/* log_edges.c */

/* Which edge pixels do not run straight on to both sides for a length, px: the gradient there, in
   scaled units of the image, is not a share of their strength along theirs, or is turned, by a share
   of its square. */
void bent_edges(count h, count w, rows k, const int16_t log[h][w], const int32_t x[k],
                const int32_t y[k], const float unit_x[k], const float unit_y[k],
                const float strength[k], float scale, float length, float continued,
                float straight, bool bent[k]);

/* votes.c */

void count_votes(count n, count p, count s, count d, count tall, count wide, const double x[n],
                 const double y[n], const float unit_x[n], const float unit_y[n],
                 const float steps[p][s], const float cosines[d], const float sines[d],
                 float squared_aspect, float flat, uint16_t votes[p][d][tall][wide]);
void highest_cells(count n, const int64_t cells[n], const float values[n], int64_t wide,
                   int64_t reach, bool highest[n]);
void vote_peaks(count rows, count wide, count most, const uint16_t votes[rows][wide], float own,
                float needed, float enough, float flat, int64_t reach, int64_t cells[most],
                float sums[most], float shift[2][most], bool highest[most]);

/* blobs.c */

/* Blobs of pixels that are set, of at least so many pixels and of a length, px, of up to 1000: the
   first pixel, how many there are, the longer side, the highest value, the means of x and y, and the
   central moments xx, xy and yy. Where there are fewer than `most`, the sizes of the others are 0. */
void blobs(count h, count w, count most, const bool set[h][w], const uint8_t values[h][w],
           int64_t fewest, int64_t longest, int64_t first[most], int64_t size[most],
           int64_t length[most], uint8_t highest[most], double moments[5][most],
           int64_t scratch[2][w][14]);

/* triples.c */

/* Triples of d dots, and the maps from a plane of the print to pixels that they imply. The first two
   are the ends of a pair, of n that come with their offsets in the unit of their first dot, whose map
   to pixels is known; the third is where a turn takes the second, within an error, a share of the
   length and what is added: the end of one of the pairs from `begin` on. The basis takes the print to
   two unit vectors. In ln, axes of dots may be as far from the printed ones as is allowed for each,
   and all are larger by a factor between two scales. */
void likely_triples(count n, count d, count k, count most, const int64_t ends[n][2],
                    const double offsets[n][2], const double maps[d][2][2],
                    const double inverses[d][2][2], const double allowed[d], const double turn[2],
                    const double basis[2][2], const double printed[3], const double error[2],
                    const double scales[2], const int64_t partners[k], const int64_t begin[k],
                    const int64_t end[k], int64_t triples[most][3],
                    double affine[most][2][2], int64_t found[1]);

/* homographies.c */

/* Homographies from points to their images, whose weights are inverse covariances, and the
   covariances of the images of the origin. Before, an object that reaches so far has no perspective,
   which has a weight; the other unknowns have a weak one. */
void fitted_homographies(rows k, count m, const double points[k][m][2],
                         const double images[k][m][2], const double weights[k][m][2][2],
                         double reach, double weak, double perspective, double least_depth,
                         int16_t rounds, double homographies[k][3][3], double covariance[k][2][2]);

/* cctag_rays.c */

/* Gray values at n evenly spaced radii of m rays of targets, over the light, whose slope is known at
   s radii, and over their mean. Where a share of them, `many`, is beyond the limits up to which none
   is clipped, `apart` is not 0: so many radii away is what interpolation mixes with each, by the share
   `mixed`, and nothing is brighter than `highest`. */
void cctag_lit(count h, count w, rows k, count m, count n, count s, const float gray[h][w],
               const double frames[k][3][3], const double directions[2][m], const double radii[n],
               const double lights[k][3][3], const double heights[k][5],
               const double edges[k][3][5], const double width[k], const double blur[k],
               const float slope[k][s], const double known[s], double most,
               const double limits[2], double white, double many, double interpolated,
               float values[k][m][n], float highest[k][m][n], float mixed[k][m][n],
               int32_t apart[k], float rows[5][n]);
/* Rays as linear functions of ink, paper + step ink, whose weights lose outliers in some rounds: an
   error of `outlier` usual deviations leaves a quarter. Then the normal equations of changes of the
   frame and of edges, without what another paper and ink of a ray explain. The model is what a camera
   that does not clip sees, and the gain how what is seen changes by it. */
void cctag_rays(rows k, count m, count n, const float values[k][m][n],
                const float highest[k][m][n], const float mixed[k][m][n], const int32_t apart[k],
                const float ink[k][n], const float by_radius[k][n], const float by_shift[k][n],
                const float by_blur[k][n], const float by_sharpening[k][n], const float along[n],
                const double around[m][7], int16_t rounds, double outlier, double other_contrast,
                double quiet, double normal_spread, double least, int16_t rounds_of_clipped,
                double least_gain, float weight[k][m][n], float model[k][m][n],
                float errors[k][m][n], float gain[k][m][n], double step[k][m], double variance[k],
                double normal[k][10][10], double right[k][10], double contrast[2][m],
                double sizes[n], float products[n][36], float basis[n][8], float rows[2][n]);

/* cctag_rings.c */

/* Ink of circles, whose radii are below 0 where paper fills them, along rays, and its changes by
   the radius, by the shift, px, by ln of the blur, and by the sharpening by an unsharp mask. */
void cctag_rings(rows k, count c, count n, const double circles[k][c], const double size[k],
                 const double shift[k], const double blur[k], const double sharpening[k],
                 const float along[n], double mask, float ink[k][n], float by_radius[k][n],
                 float by_shift[k][n], float by_blur[k][n], float by_sharpening[k][n],
                 float row[2][n]);

/* outlines.c */

/* Areas, px^2, positive where they are clockwise in an image, lengths and boxes, px. */
void outline_sizes(count n, count k, const int32_t points[n][2], const int64_t ends[k],
                   double areas[k], double lengths[k], int64_t boxes[k][2]);

/* straight.c */

/* Straight edges among marked pixels, by their ends, px, with what is bright on the left, and their
   number. The gradients of an edge differ by an angle at the most: by a smaller one where its pixels
   are not near to a line, by the root of their mean square distance. */
void straight_edges(count h, count w, count m, count e, const uint8_t marked[h][w],
                    const int16_t across[h][w], const int16_t down[h][w], double cosine,
                    double strict, double least, double away, double edges[m][4], int64_t found[1],
                    int32_t taken[e], uint8_t left[h][w]);
/* Quadrilaterals that edges enclose, dark inside and clockwise in the image, and their number. Two
   edges meet up to a gap beyond their ends, px, and so many of their lengths; the third gap is how far
   an edge goes on. The rules say which edges are one side: the cosine of their angle, their distance
   from one line, px and as a share of the distance between them, the share of the side that they show,
   and how long it is, px. */
void edge_quadrilaterals(count n, count tall, count wide, count c, count l, count q,
                         const double edges[n][4], double side, const double gaps[3],
                         double overlap, double turn, const double rules[5], double apart,
                         double corners[q][4][2], int64_t found[1], int64_t cells[tall][wide],
                         int64_t next[n], int64_t follows[n], int64_t begin[n], int64_t end[n],
                         int64_t second[c], double places[c][2], int64_t first_link[c],
                         int64_t last_link[c], int64_t links[l], int64_t next_one[q]);

/* square_places.c */

void square_frames(count k, const double corners[k][4][2], double frames[k][3][3]);
void taken_places(count k, count n, const double places[k][2], const double reach[k],
                  const double points[n][2], bool taken[k]);
void place_owners(count k, const double places[k][2], const double reach[k],
                  const int64_t kinds[k], int64_t most, bool owning[k]);
void place_rivals(count k, const double places[k][2], const double reach[k],
                  const int64_t groups[k], const int64_t numbers[k], const double odds[k],
                  double none, double no_number, double of_groups[k], double of_numbers[k]);

/* square_cells.c */

/* Which quadrilaterals are bright outside and dark inside all sides, at distances from the middle:
   for a share of places along each, paper is so many times brighter. */
void dark_inside(count h, count w, rows k, count n, const uint8_t gray[h][w],
                 const double frames[k][3][3], const double along[n], double outside,
                 double inside, double offset, double times, double share, bool dark[k]);
/* By how much the log odds of markers of n by n cells grow where a cell is paper, and those where
   all are ink; those of square corners; which borders are seen at all, and which are whole. A grid
   has s by s cells, of some size, px, with the border and one more cell of paper around it. Each is
   read by the mean of the parts of its cells, and where light may be spread, by the darkest part of
   each, too. Where light changes along the border, cells are compared with its brightest ink and the darkest paper. Either has a price. */
void cell_evidence(count h, count w, rows k, count s, count n, const uint8_t gray[h][w],
                   const double frames[k][3][3], const double sizes[k][2], const double blurs[k],
                   const bool spread[k], const double window[s], const double places[5][2],
                   double offset, double most_mixed, double minimum_step, double of_usual,
                   double share, double everywhere, double sharpness, double most, double unclear,
                   double unusual, const double weights[3], double corner, bool seen[2][k],
                   float paper[2][k][n][n], double odds[3][2][k], double levels[6][s][s],
                   double sums[6][3][s]);

/* square_steps.c */

/* By how much the log odds of markers of n by n cells grow where the cell behind a line is darker than
   the one before it, and where it is brighter: line by line, upright lines first. Then the odds of a
   marker whose cells are all ink, with a share of those of the border; of square corners; and of the
   border. A grid has s by s cells, border included, t = s + 1 lines either way, and c = s + 2 cells with
   those around it. Steps of the logarithm are taken at m places along a line, on either side of it,
   without what blur mixes in from other cells, and compared with the usual step across the sides, which
   must not be too small. Their deviation grows by the second of two numbers, times the share that blur
   mixes in. Light makes steps of any height, at a low density. */
void step_evidence(count h, count w, rows k, count s, count t, count n, count f, count m,
                   count c, const uint8_t gray[h][w], const double frames[k][3][3],
                   const double sizes[k][2], const double places[m], double aside, double offset,
                   double least, const double deviation[2], double stray, double weight,
                   double of_border, const double corner[4], bool seen[k], float features[k][f],
                   double odds[3][k], double scale[c], double light[2][c][c],
                   double steps[2][t][s][m], double sides[4][s][m]);

/* square_words.c */

/* The likeliest of w words in four turns, its log odds and those of others against it, where they
   are possible, and otherwise a bound of its log odds. Words have bits, and a prior against them; few
   edges speak against them as cells, and corners for them as shapes. */
void likeliest_words(rows k, count c, count b, count w, const float paper[k][c],
                     const double ink[k], const double square[k], const bool anyway[k],
                     const uint8_t words[b][w][4], const float prior[w], const double few[w],
                     const double shapes[w], double doubt, double figures, double possible,
                     int64_t best[k][2], double total[k], double others[k], bool likely[k],
                     float sums[b][256], float odds[w][4]);

/* square_prints.c */

/* Prints of k markers of n by n cells, laid over an image from frames and blurs on (the first one,
   the least and the most, in sides), where samples at m places along either side, in cells of
   their own, are more than `inner` from the middle. Shares are of samples that look like the print,
   0 where it did not settle; covariances are those of shifts of the frame. */
void laid_prints(count h, count w, rows k, count n, count m, count g, const float gray[h][w],
                 const double start[k][3][3], const bool ink[k][n][n], const double places[m],
                 const int32_t cells[m], const double blurs[k][3], double inner,
                 double largest_step, double settled, double outlier, double normal_spread,
                 double least, double agrees, double hopeless, double ridge, int16_t rounds,
                 double frames[k][3][3], double unknowns[k][16], double shares[k],
                 double covariance[k][2][2], double fields[10][m][m], double share[3][n][m],
                 double samples[2][m][16], double sums[g][g][3]);

/* ellipses.c */

/* Which of s outlines about points, and in which of the sizes radii[1] to radii[20], has the highest
   mean step, from dark to bright times a scale. Outlines are in steps of the sizes, from the first
   one: a whole number of them, and what is beside; each has a least size. */
void best_outlines(count h, count w, rows k, count s, const int16_t log[h][w],
                   const double points[k][2], const double scale[k], const double rays[2][24],
                   const double radii[22], const int32_t bins[s][24], const float beside[s][24],
                   const double least[s], const double counted[2], int32_t best[k][2],
                   double scores[k]);
/* Frames of ellipses moved onto the strongest steps in a window (px, least and most radii) along up
   to 64 rays, and the share of rays with a clear step that is near. */
void moved_ellipses(count h, count w, rows k, count m, const int16_t log[h][w],
                    const double start[k][3][3], const double scale[k], const double rays[2][m],
                    const double basis[m][5], const double places[13], const double window[3],
                    const double counted[2], double flat, double least, double clear,
                    double outlier, int16_t rounds, const double prior[5], const double inlier[2],
                    double frames[k][3][3], double shares[k]);
/* What makes ellipses as large as they are in gray values. */
void gray_sizes(count h, count w, rows k, const int16_t log[h][w], const double frames[k][3][3],
                const double polarity[k], const double rays[2][16], const double places[13],
                const double window[3], double unit, double flat, double sizes[k]);

#endif
