/* Counting lookups, crossings and violations, in a compilation of its own: timed kernels do without. */
#define count(counter, where) ((counter) -= (where))
