/* A flight that may end at a collision with the control: the optical depth of the control at which it does. */
static void target_control(Path *path, Rng *rng)
{
    Rng control_rng = companion(rng);
    path->target = exponential(&control_rng);
}

/* The nearer of two independent exponential distances inside a span of constant coefficients: to the next
   tentative collision with the residual and to the collision with the control. FAR where neither happens. */
static real to_residual(const Path *path, const real draw, const real span)
{
    return choose(less(draw, path->majorant * span), draw * path->mean_free_path, (real)FAR);
}

static real to_control(const Path *path, const real span)
{
    const real left = path->target - path->control_flown;
    return choose(less(left, path->state.control * span), left / path->state.control, (real)FAR);
}

/* The residual at a tentative collision, of trackers that need it between 0 and its majorant; where it is
   not, by more than rounding, that is a violation. */
static real bounded_residual(Path *path, const Scene *scene, const mask here)
{
    const real sigma = sigma_t(path, scene, path->t, here);
    const real residual = sigma - path->state.control;
    const real slack = (SCALAR)0.000001 * (fabs(sigma) + path->majorant);
    count(path->violations, here & (less(residual, -slack) | less(path->majorant + slack, residual)));
    return residual;
}
