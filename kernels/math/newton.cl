/* Newton's method inside a bracket, for a root of an increasing function. A step that would leave the
   bracket, or that is not half as long as the one before, gives way to one that halves the bracket: so
   neither a vanishing slope nor a cycle between two points does harm. */
#define NEWTON_STEPS 64
/* Steps of this size, relative, are those of the function's own rounding around its root. */
#define NEWTON_SETTLED ((SCALAR)8 * (SCALAR)ROUNDING)

typedef struct {
    real low, high, at;
    real step;                /* length of the last one; FAR at first */
} Bracket;

/* One step, given the function's excess over the wanted value and its slope; returns the lanes that
   have not settled. */
static mask newton(Bracket *bracket, const real excess, const real slope)
{
    const mask below = less(excess, (real)0);
    bracket->low = choose(below, bracket->at, bracket->low);
    bracket->high = choose(below, bracket->high, bracket->at);
    const mask root = equal(excess, (real)0);
    const real tangent = choose(root, bracket->at, bracket->at - excess / slope);
    const real change = fabs(tangent - bracket->at);
    /* A root that is found is an end of the bracket, and must not be left again for its middle. */
    const mask settled = root | less(change, NEWTON_SETTLED * bracket->at);
    const mask inside = less(bracket->low, tangent) & less(tangent, bracket->high);
    const mask good = settled | (inside & less((SCALAR)2 * change, bracket->step));
    const real next = choose(good, tangent, (SCALAR)0.5 * (bracket->low + bracket->high));
    bracket->step = fabs(next - bracket->at);
    bracket->at = next;
    return less(NEWTON_SETTLED * fabs(next), bracket->step);
}
