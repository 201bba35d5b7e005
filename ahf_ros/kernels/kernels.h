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

#endif
