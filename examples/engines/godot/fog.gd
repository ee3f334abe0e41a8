# Reads what `fogbow bake … -o fog.json` writes (fog.json, fog.bin) into the uniforms of fog.gdshaderinc.
extends MeshInstance3D

func _ready() -> void:
	var about: Dictionary = JSON.parse_string(FileAccess.get_file_as_string("res://fog.json"))
	var data := FileAccess.get_file_as_bytes("res://" + about["data"])
	var arrays := {}
	for a in about["arrays"]:
		arrays[a["name"]] = data.slice(int(a["offset"]), int(a["offset"] + a["bytes"]))
	var states: PackedByteArray = arrays["state"]
	var extinction: PackedFloat32Array = arrays["extinction"].to_float32_array()
	var valid := func(i: int) -> float: return 1.0 if states[i] == 1 else 0.0
	var thickness := func(i: int) -> float: return (extinction[3 * i] + extinction[3 * i + 1] + extinction[3 * i + 2]) / 3.0
	var nothing := func(_i: int) -> float: return 0.0
	var set_texture := func(uniform: String, array: String, alpha: Callable) -> void:
		material_override.set_shader_parameter(uniform, _texture(about["counts"], arrays[array].to_float32_array(), alpha))
	for k in range(9):
		set_texture.call("sh%d" % k, "sh%d" % k, valid)
	set_texture.call("medium", "albedo", thickness)
	set_texture.call("wall0", "wall0", nothing)
	set_texture.call("wall1", "wall1", nothing)
	var low := _vector(about["box"]["min"])
	material_override.set_shader_parameter("probes_corner", low)
	material_override.set_shader_parameter("probes_size", _vector(about["box"]["max"]) - low)
	material_override.set_shader_parameter("probes_scale", float(about["scale"]))
	material_override.set_shader_parameter("probes_numbers", 9)

func _vector(of: Array) -> Vector3:
	return Vector3(of[0], of[1], of[2])

func _texture(counts: Array, colours: PackedFloat32Array, alpha: Callable) -> ImageTexture3D:
	var slices: Array[Image] = []
	var each := int(counts[0] * counts[1])
	for z in range(int(counts[2])):
		var texels := PackedFloat32Array()
		texels.resize(4 * each)
		for i in range(each):
			var probe := z * each + i
			for c in range(3):
				texels[4 * i + c] = colours[3 * probe + c]
			texels[4 * i + 3] = alpha.call(probe)
		slices.append(Image.create_from_data(int(counts[0]), int(counts[1]), false, Image.FORMAT_RGBAF, texels.to_byte_array()))
	var texture := ImageTexture3D.new()
	texture.create(Image.FORMAT_RGBAF, int(counts[0]), int(counts[1]), int(counts[2]), false, slices)
	return texture
