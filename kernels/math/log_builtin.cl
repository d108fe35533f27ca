/* The natural logarithm of a positive normal number, by the device's own function. */
static real logarithm(const real x) { return log(x); }
