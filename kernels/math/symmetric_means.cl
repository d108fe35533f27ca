/* Elementary symmetric means: means[k] is the mean of all products of k out of the numbers so far. In lanes
   `where` one more number joins as the count-th (Kettunen, d'Eon, Pantaleoni, Novak 2021, section 4.3). Start
   with means[0] = 1 and the others 0. Means stay of the size of the numbers' powers, where sums and binomials
   would grow. */
static void symmetric_means_join(real *means, const int count, const real number, const mask where)
{
    for (int k = count; k >= 1; --k) {
        const real with = means[k - 1] * number;
        const real mean = means[k] + (with - means[k]) * ((SCALAR)k / (SCALAR)count);
        means[k] = choose(where, mean, means[k]);
    }
}
