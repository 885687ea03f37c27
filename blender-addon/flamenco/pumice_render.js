// SPDX-FileCopyrightText: The Pumice developers
// SPDX-License-Identifier: GPL-3.0-or-later

// A job type of Flamenco 3: the frames of a .blend file, drawn by Pumice, a chunk of them in each task.
//
//     frames "1-30, 40", chunk size 10 ──► frameChunker ──► a task a chunk ──► blender {blenderArgs} FILE … --render-frame 1..10
//
// It differs from Flamenco's own Simple Blender Render in these, all before the frames:
//
//     --engine PUMICE           a node without the extension fails; without this argument Blender draws the proxies with another engine
//     --python-exit-code 1      a node where the next argument fails, fails
//     --python-expr …           also settings of the node's extension (memory limit, processor) and samples, where the job sets them
//     chunks of ten frames      an open volume, and what rays need of it, serve all frames of a chunk
//
// It makes no preview video. Copy it into the folder `scripts` beside flamenco-manager.

const JOB_TYPE = {
    label: "Pumice Render",
    description: "Render a sequence of frames with Pumice",
    settings: [
        {
            key: "frames", type: "string", required: true,
            eval: "f'{C.scene.frame_start}-{C.scene.frame_end}'",
            evalInfo: { showLinkButton: true, description: "Frames of the scene" },
            description: "Frames to render, such as '47', '1-30' or '3, 5-10, 47-327'",
        },
        {
            key: "chunk_size", type: "int32", default: 10, propargs: { min: 1 }, visible: "submission",
            description: "Frames of one task. Each task opens the volumes anew",
        },
        {
            key: "memory_limit", type: "int32", default: 0, propargs: { min: 0 }, visible: "submission",
            description: "MiB of memory that volumes hold at most on a node; the processor then draws. 0 leaves each node its own preference",
        },
        {
            key: "device", type: "string", choices: ["node", "cpu"], default: "node", visible: "submission",
            description: "The device of each node's preferences, or the processor, whose pictures are the same on all nodes",
        },
        {
            key: "samples", type: "int32", default: 0, propargs: { min: 0 }, visible: "submission",
            description: "Samples per pixel. 0 leaves those of the file",
        },
        {
            key: "render_output_root", type: "string", subtype: "dir_path", required: true, visible: "submission",
            description: "Folder of pictures. Parts that name the job are added to it",
        },
        {
            key: "add_path_components", type: "int32", required: true, default: 0, propargs: { min: 0, max: 32 }, visible: "submission",
            description: "Number of folders above the file that become parts of the path",
        },
        {
            key: "render_output_path", type: "string", subtype: "file_path", editable: false,
            eval: "str(Path(abspath(settings.render_output_root), last_n_dir_parts(settings.add_path_components), jobname, '{timestamp}', '######'))",
            description: "Path of the pictures",
        },
        { key: "blendfile", type: "string", required: true, visible: "web", description: "The file to render" },
        { key: "scene", type: "string", required: true, eval: "C.scene.name", visible: "web", description: "The scene to render" },
        { key: "format", type: "string", required: true, eval: "C.scene.render.image_settings.file_format", visible: "web" },
    ],
};

const VIDEOS = ["FFMPEG", "AVI_RAW", "AVI_JPEG"];

function compileJob(job) {
    const settings = job.settings;
    if (VIDEOS.indexOf(settings.format) >= 0) {
        throw "Pumice Render writes pictures: choose a file format other than " + settings.format;
    }
    if (!settings.render_output_path) {
        throw "Pumice Render needs render_output_path";
    }
    // Flamenco shows the path that is used.
    settings.render_output_path = settings.render_output_path.split("{timestamp}").join(formatTimestampLocal(job.created));
    for (const chunk of frameChunker(settings.frames, settings.chunk_size)) {
        const task = author.Task("render-" + chunk, "blender");
        const parameters = {
            exe: "{blender}",
            exeArgs: "{blenderArgs}",
            argsBefore: [],
            blendfile: settings.blendfile,
            args: blenderArguments(settings, chunk),
        };
        // Flamenco 3.8 and newer show how many of these steps are done.
        const steps = typeof frameCount === "function" ? frameCount(chunk) : 0;
        task.addCommand(author.Command("blender-render", parameters, steps));
        job.addTask(task);
    }
}

// What follows the file in a call of Blender, which obeys arguments in their order.
function blenderArguments(settings, chunk) {
    const scene = settings.scene ? ["--scene", settings.scene] : [];
    const python = ["--python-exit-code", "1", "--python-expr", pythonSettings(settings)];
    const frames = ["--render-output", settings.render_output_path, "--render-frame", chunk.split("-").join("..")];
    return scene.concat(["--engine", "PUMICE"], python, frames);
}

// The Python that sets how pictures are written, and what the job sets.
function pythonSettings(settings) {
    // A task that runs once more draws only the frames whose pictures are not there, and their names have the format's extension. Flamenco's
    // add-on set both in the file that it sent, and since version 3.9 leaves them to the job type.
    const lines = [
        "import bpy",
        "render = bpy.context.scene.render",
        "render.use_overwrite = render.use_placeholder = False",
        "render.use_file_extension = True",
    ];
    if (settings.memory_limit > 0 || settings.device === "cpu") {
        // The name of the extension begins with that of the repository that the node has installed it in.
        lines.push("p = next(a.preferences for a in bpy.context.preferences.addons if a.module.split('.')[-1] == 'pumice')");
    }
    if (settings.memory_limit > 0) {
        lines.push("p.memory_limit = " + Math.floor(settings.memory_limit));
    }
    if (settings.device === "cpu") {
        lines.push("p.backend = 'cpu'");
    }
    if (settings.samples > 0) {
        lines.push("bpy.context.scene.pumice.samples = " + Math.floor(settings.samples));
    }
    return lines.join("; ");
}
