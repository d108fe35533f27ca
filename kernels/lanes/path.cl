/* A flight along a ray, and what happened on it so far. */
typedef struct {
    Ray ray;
    real t;                   /* distance flown */
    real depth;               /* optical depth flown, of trackers that accumulate it */
    real majorant_flown;      /* that of the majorant, of walks cell by cell */
    real control_flown;       /* that of the control */
    real target;              /* the optical depth, flown or of the control, at which a flight collides */
    real majorant;            /* where the path is now */
    real mean_free_path;      /* 1 / majorant, FAR where the majorant is 0 */
    real weight;
    mask live;                /* -1 while the path goes on */
    mask escaped;             /* -1 once it has left the medium */
    index steps;
    index lookups, crossings, violations;    /* since the last tally, counted where count is on */
    State state;              /* of the walk, the channels and the tracker: fields of their front matter */
} Path;

/* Lanes `where` fly on as `from` does, on the ray that they have. */
static void take_flight(Path *into, const Path *from, const mask where)
{
    into->t = choose(where, from->t, into->t);
    into->depth = choose(where, from->depth, into->depth);
    into->majorant_flown = choose(where, from->majorant_flown, into->majorant_flown);
    into->control_flown = choose(where, from->control_flown, into->control_flown);
    into->target = choose(where, from->target, into->target);
    into->majorant = choose(where, from->majorant, into->majorant);
    into->mean_free_path = choose(where, from->mean_free_path, into->mean_free_path);
    into->weight = choose(where, from->weight, into->weight);
    into->live = choose(where, from->live, into->live);
    into->escaped = choose(where, from->escaped, into->escaped);
    into->steps = choose(where, from->steps, into->steps);
    into->lookups = choose(where, from->lookups, into->lookups);
    into->crossings = choose(where, from->crossings, into->crossings);
    take_state(&into->state, &from->state, where);
}

/* Lanes `where` are at the start of their rays. */
static void start_flight(Path *path, const mask where)
{
    path->t = choose(where, (real)0, path->t);
    path->depth = choose(where, (real)0, path->depth);
    path->majorant_flown = choose(where, (real)0, path->majorant_flown);
    path->control_flown = choose(where, (real)0, path->control_flown);
    path->target = choose(where, (real)0, path->target);
}

/* The extinction at distance t: the only place where a lookup happens and is counted. */
static real sigma_t(Path *path, const Scene *scene, const real t, const mask here)
{
    count(path->lookups, here);
    const Vector place = place_on(&path->ray, t);
    return sigma_t_at(scene, place.x, place.y, place.z);
}

/* Lanes `where` have collided: the flight ends at t, inside the medium. */
static void collide(Path *path, const mask where) { path->live &= ~where; }

/* Lanes `where` leave the medium. */
static void escape(Path *path, const mask where)
{
    path->t = choose(where, path->ray.length, path->t);
    path->escaped |= where;
    path->live &= ~where;
}

/* Lanes `where` leave the medium, of trackers that know the optical depth they flew through. */
static void escape_through_depth(Path *path, const mask where)
{
    if (any_lane(where))
        path->weight = choose(where, path->weight * attenuation(path->depth), path->weight);
    escape(path, where);
}
