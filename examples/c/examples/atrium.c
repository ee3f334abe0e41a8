/* Digests of the caches and of a picture of an atrium: the same ones as in Rust, on every machine.
 *
 *   cc -std=c99 -O2 atrium.c $(pkg-config --cflags --libs fogbow) -lm && ./a.out [picture.ppm]
 */
#include "atrium.h"

#include "digests.h"

int main(int count, char **names) {
    /* Rougher than usual, so that this takes seconds. */
    const fogbow_settings settings = {.size = sizeof settings, .error = 0.1f, .rays = 64, .walks = 16};
    fogbow_world *world;
    check(atrium(&world));
    print_digests(world, &settings, &atrium_camera);
    check(fogbow_world_free(world));
    return count > 1 ? write_picture(names[1]) : 0;
}
