// fogbow for C++17: handles that free themselves, errors as exceptions, callbacks as lambdas. All else is fogbow.h.
#ifndef FOGBOW_HPP
#define FOGBOW_HPP

#include "fogbow.h"

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace fogbow {

/// What a function of fogbow.h has returned, with its message.
class Error : public std::runtime_error {
public:
    explicit Error(fogbow_status status)
        : std::runtime_error(std::string(fogbow_status_text(status)) + ": " + fogbow_message()), status(status) {}
    fogbow_status status;
};

inline void check(fogbow_status status) {
    if (status != FOGBOW_OK) throw Error(status);
}

/// A structure with its size set and all else 0.
template <class T>
T make() {
    T made{};
    made.size = sizeof(T);
    return made;
}

struct Deleter {
    void operator()(fogbow_medium *handle) const noexcept { fogbow_medium_free(handle); }
    void operator()(fogbow_world *handle) const noexcept { fogbow_world_free(handle); }
    void operator()(fogbow_caches *handle) const noexcept { fogbow_caches_free(handle); }
    void operator()(fogbow_work *handle) const noexcept { fogbow_work_free(handle); }
    void operator()(fogbow_result *handle) const noexcept { fogbow_result_free(handle); }
    void operator()(fogbow_probes *handle) const noexcept { fogbow_probes_free(handle); }
};

/// The one owner of a handle.
template <class T>
using Handle = std::unique_ptr<T, Deleter>;

/// The handle that a function of fogbow.h gives by its last argument: `make_handle<fogbow_medium>(fogbow_medium_homogeneous, &fog)`.
template <class T, class Function, class... Arguments>
Handle<T> make_handle(Function function, Arguments... arguments) {
    T *handle = nullptr;
    check(function(arguments..., &handle));
    return Handle<T>(handle);
}

using Vector = std::array<float, 3>;

/// A medium; copies share it.
class Medium {
public:
    static Medium homogeneous(const fogbow_properties &properties) {
        return Medium(make_handle<fogbow_medium>(fogbow_medium_homogeneous, &properties));
    }
    /// From densities, x fastest, of the box between two corners.
    static Medium grid(std::array<std::uint32_t, 3> counts, const std::vector<float> &densities,
                       const fogbow_properties &properties, const fogbow_box &box) {
        auto grid = make<fogbow_grid>();
        for (int i = 0; i < 3; i++) {
            grid.counts[i] = counts[i];
            grid.world_from_grid_rows[5 * i] = box.upper[i] - box.lower[i];
            grid.world_from_grid_rows[4 * i + 3] = box.lower[i];
        }
        grid.densities = densities.data();
        grid.density_count = densities.size();
        grid.properties = properties;
        return Medium(make_handle<fogbow_medium>(fogbow_medium_grid, &grid));
    }
    Medium in_box(const fogbow_box &box) const {
        return Medium(make_handle<fogbow_medium>(fogbow_medium_in_box, get(), &box));
    }
    Medium in_ball(Vector centre, float radius) const {
        fogbow_medium *handle = nullptr;
        check(fogbow_medium_in_ball(get(), centre.data(), radius, &handle));
        return Medium(Handle<fogbow_medium>(handle));
    }
    fogbow_medium *get() const { return handle_.get(); }

private:
    explicit Medium(Handle<fogbow_medium> handle) : handle_(std::move(handle)) {}
    std::shared_ptr<fogbow_medium> handle_;
};

/// The surface that a ray meets, or none. May be called by several threads at a time, and must not throw.
using ClosestHit = std::function<std::optional<fogbow_hit>(const fogbow_ray &)>;

/// A medium, surfaces and lights. Copies share it; the ray caster lives as long as it and as all work in it.
class World {
public:
    World(const Medium &medium, ClosestHit closest_hit, const std::vector<fogbow_light> &lights, const fogbow_box &bounds)
        : closest_hit_(std::make_shared<const ClosestHit>(std::move(closest_hit))) {
        auto scene = make<fogbow_host_scene>();
        scene.context = const_cast<ClosestHit *>(closest_hit_.get());
        scene.closest_hit = [](void *context, const fogbow_ray *ray, fogbow_hit *hit) noexcept -> std::int32_t {
            const auto found = (*static_cast<const ClosestHit *>(context))(*ray);
            if (found) *hit = *found;
            return found ? 1 : 0;
        };
        auto parts = make<fogbow_world_parts>();
        parts.medium = medium.get();
        parts.scene = *closest_hit_ ? &scene : nullptr;
        parts.lights = lights.data();
        parts.light_count = lights.size();
        parts.bounds = bounds;
        handle_ = make_handle<fogbow_world>(fogbow_world_new, &parts);
    }
    fogbow_world *get() const { return handle_.get(); }

private:
    std::shared_ptr<const ClosestHit> closest_hit_; // Freed after what uses it.
    std::shared_ptr<fogbow_world> handle_;
};

/// Work in jobs. `run` may be called by any thread, many at a time; so may `accept`.
class Work {
public:
    Work(World world, Handle<fogbow_work> handle) : world_(std::move(world)), handle_(std::move(handle)) {}
    /// Numbers of the jobs that are due, from the first to below the second; equal if all is done.
    std::pair<std::uint32_t, std::uint32_t> jobs() const {
        std::pair<std::uint32_t, std::uint32_t> due;
        check(fogbow_work_jobs(get(), &due.first, &due.second));
        return due;
    }
    Handle<fogbow_result> run(std::uint32_t job) const { return make_handle<fogbow_result>(fogbow_work_run, get(), job); }
    void accept(Handle<fogbow_result> result) const { check(fogbow_work_accept(get(), result.release())); }
    /// All jobs on this thread.
    void finish() const { check(fogbow_work_step(get(), 0, nullptr)); }
    fogbow_work *get() const { return handle_.get(); }

private:
    World world_; // Its ray caster is used by jobs.
    Handle<fogbow_work> handle_;
};

/// Light in a world, cached.
class Caches {
public:
    Caches(World world, const fogbow_settings &settings)
        : world_(std::move(world)), handle_(make_handle<fogbow_caches>(fogbow_caches_new, world_.get(), &settings)) {}
    Work fill(const fogbow_view &view) {
        return Work(world_, make_handle<fogbow_work>(fogbow_fill_view, get(), world_.get(), &view));
    }
    Work fill(const fogbow_box &box) {
        return Work(world_, make_handle<fogbow_work>(fogbow_fill_box, get(), world_.get(), &box));
    }
    Work audit(const fogbow_view &view, std::uint32_t rays = 0) const {
        return Work(world_, make_handle<fogbow_work>(fogbow_audit, get(), world_.get(), &view, rays));
    }
    std::vector<Vector> radiance(const std::vector<fogbow_ray> &rays, const fogbow_chance &chance) const {
        std::vector<Vector> light(rays.size());
        auto *floats = reinterpret_cast<float *>(light.data());
        check(fogbow_radiance(get(), world_.get(), rays.data(), rays.size(), chance, floats, nullptr));
        return light;
    }
    std::vector<unsigned char> save(std::uint64_t tag) const {
        std::size_t needed = 0;
        check(fogbow_caches_save(get(), tag, nullptr, 0, &needed));
        std::vector<unsigned char> bytes(needed);
        check(fogbow_caches_save(get(), tag, bytes.data(), bytes.size(), nullptr));
        return bytes;
    }
    void load(std::uint64_t tag, const std::vector<unsigned char> &bytes) {
        check(fogbow_caches_load(get(), tag, bytes.data(), bytes.size()));
    }
    const World &world() const { return world_; }
    fogbow_caches *get() const { return handle_.get(); }

private:
    World world_;
    Handle<fogbow_caches> handle_;
};

/// A grid of probes.
class Probes {
public:
    /// Those of a bake, as far as it is done.
    static Probes of(const Work &bake) { return Probes(make_handle<fogbow_probes>(fogbow_bake_take, bake.get())); }
    /// The bake of a world, from caches or (without) by paths.
    static Work bake(const World &world, const fogbow_bake_settings &settings, const Caches *caches = nullptr) {
        auto *from = caches ? caches->get() : nullptr;
        return Work(world, make_handle<fogbow_work>(fogbow_bake, world.get(), from, &settings));
    }
    static Probes load(std::uint64_t tag, const std::vector<unsigned char> &bytes) {
        return Probes(make_handle<fogbow_probes>(fogbow_probes_load, tag, bytes.data(), bytes.size()));
    }
    Vector value(Vector point, Vector direction) const {
        Vector light{};
        check(fogbow_probes_value(get(), point.data(), direction.data(), 1, light.data()));
        return light;
    }
    fogbow_probes_state state() const {
        auto state = make<fogbow_probes_state>();
        check(fogbow_probes_look(get(), &state));
        return state;
    }
    std::vector<unsigned char> save(std::uint64_t tag) const {
        std::size_t needed = 0;
        check(fogbow_probes_save(get(), tag, nullptr, 0, &needed));
        std::vector<unsigned char> bytes(needed);
        check(fogbow_probes_save(get(), tag, bytes.data(), bytes.size(), nullptr));
        return bytes;
    }
    fogbow_probes *get() const { return handle_.get(); }

private:
    explicit Probes(Handle<fogbow_probes> handle) : handle_(std::move(handle)) {}
    Handle<fogbow_probes> handle_;
};

} // namespace fogbow

#endif
