/* A flight along a ray, and what happened on it so far. Positions are in medium coordinates; t, length
   and every coefficient are per unit of world length. */
typedef struct {
    real origin_x, origin_y, origin_z;
    real direction_x, direction_y, direction_z;
    real length;              /* of the ray inside the medium */
    real t;                   /* distance flown */
    real depth;               /* optical depth flown, of trackers that accumulate it */
    real target;              /* the optical depth at which those collide */
    real majorant;            /* where the path is now */
    real mean_free_path;      /* 1 / majorant, FAR where the majorant is 0 */
    real weight;
    mask live;                /* -1 while the path goes on */
    mask escaped;             /* -1 once it has left the medium */
    index steps;
    index lookups, crossings, violations;    /* since the last tally, counted where count is on */
    State state;              /* of the walk, the channels and the tracker: fields of their front matter */
} Path;

/* The extinction at distance t: the only place where a lookup happens and is counted. */
static real sigma_t(Path *path, const Scene *scene, const real t, const mask here)
{
    count(path->lookups, here);
    return sigma_t_at(scene, path->origin_x + t * path->direction_x, path->origin_y + t * path->direction_y,
                      path->origin_z + t * path->direction_z);
}

/* Lanes `where` have collided: the flight ends at t, inside the medium. */
static void collide(Path *path, const mask where) { path->live &= ~where; }

/* Lanes `where` leave the medium. */
static void escape(Path *path, const mask where)
{
    path->t = choose(where, path->length, path->t);
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
