/* Places, directions and rays, in medium coordinates; t, length and every coefficient are per unit of world
   length. */
typedef struct {
    real x, y, z;
} Vector;

typedef struct {
    index x, y, z;
} Indices;

typedef struct {
    Vector origin, direction;
    real length;              /* inside the medium */
} Ray;

static Vector place_on(const Ray *ray, const real t)
{
    const Vector place = {ray->origin.x + t * ray->direction.x, ray->origin.y + t * ray->direction.y,
                          ray->origin.z + t * ray->direction.z};
    return place;
}

static real dot_of(const Vector a, const Vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

static real least_of(const Vector v)
{
    const real nearer = smaller(v.x, v.y);
    return smaller(nearer, v.z);
}

static void take_vector(Vector *into, const Vector *from, const mask where)
{
    into->x = choose(where, from->x, into->x);
    into->y = choose(where, from->y, into->y);
    into->z = choose(where, from->z, into->z);
}

static void take_indices(Indices *into, const Indices *from, const mask where)
{
    into->x = choose(where, from->x, into->x);
    into->y = choose(where, from->y, into->y);
    into->z = choose(where, from->z, into->z);
}

static void take_ray(Ray *into, const Ray *from, const mask where)
{
    take_vector(&into->origin, &from->origin, where);
    take_vector(&into->direction, &from->direction, where);
    into->length = choose(where, from->length, into->length);
}
