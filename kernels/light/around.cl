/* The direction of a cosine to an axis, at a random angle around it; a basis by Duff et al. 2017, Building an
   orthonormal basis, revisited. */
static Vector around(const Vector axis, const real cosine, const real sine, Rng *rng)
{
    real along, across;
    point_on_circle(uniform(rng), &along, &across);
    along *= sine;
    across *= sine;
    const real sign = copysign((real)1, axis.z);
    const real a = (SCALAR)-1 / (sign + axis.z), b = axis.x * axis.y * a;
    const Vector turned = {
        axis.x * cosine + along * ((SCALAR)1 + sign * axis.x * axis.x * a) + across * b,
        axis.y * cosine + along * sign * b + across * (sign + axis.y * axis.y * a),
        axis.z * cosine - along * sign * axis.x - across * axis.y,
    };
    return turned;
}

static real sine_of(const real cosine)
{
    const real square = (SCALAR)1 - cosine * cosine;
    return sqrt(larger(square, (real)0));
}
