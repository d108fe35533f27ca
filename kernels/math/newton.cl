/* Newton's method inside a bracket, for a root of an increasing function. A step that would leave the
   bracket halves it instead, so a vanishing slope does no harm. */
#define NEWTON_STEPS 40

typedef struct {
    real low, high, at;
} Bracket;

/* One step, given the function's excess over the wanted value and its slope; returns the lanes that
   still moved by more than rounding. */
static mask newton(Bracket *bracket, const real excess, const real slope)
{
    const mask below = less(excess, (real)0);
    bracket->low = choose(below, bracket->at, bracket->low);
    bracket->high = choose(below, bracket->high, bracket->at);
    const mask root = equal(excess, (real)0);
    const real tangent = choose(root, bracket->at, bracket->at - excess / slope);
    /* A root that is found is an end of the bracket, and must not be left again for its middle. */
    const mask settled = root | less(fabs(tangent - bracket->at), (SCALAR)ROUNDING * bracket->at);
    const mask inside = settled | (less(bracket->low, tangent) & less(tangent, bracket->high));
    const real next = choose(inside, tangent, (SCALAR)0.5 * (bracket->low + bracket->high));
    const real moved = fabs(next - bracket->at);
    bracket->at = next;
    return less((SCALAR)ROUNDING * fabs(next), moved);
}
