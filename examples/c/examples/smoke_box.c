/* Digests of the caches and of a picture of the smoke box: the same ones as in Rust, on every machine.
 *
 *   cc -std=c99 -O2 smoke_box.c $(pkg-config --cflags --libs fogbow) -lm && ./a.out [picture.ppm]
 */
#include "smoke_box.h"

#include "digests.h"

int main(int count, char **names) {
    /* Rougher than usual, so that this takes seconds. */
    const fogbow_settings settings = {.size = sizeof settings, .rays = 256, .walks = 32};
    fogbow_world *world;
    check(smoke_box(&world));
    print_digests(world, &settings, &smoke_box_camera);
    check(fogbow_world_free(world));
    return count > 1 ? write_picture(names[1]) : 0;
}
